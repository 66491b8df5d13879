// Offers the challenge to a pilot whose robot is ready.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

const speakOf = () => fetchWords((code) => import(`./tries/messages/${code}.js`));

let isKnown = false; // once offered, it stays in the menu: tries are shown there while the robot needs more lessons

register({
  screens: {
    challenge: {
      load: () => Promise.all([import('./challenge-screen.js'), speakOf()]),
      isOffered: ({ readiness, lead }) => (isKnown || readiness?.stage === 'ready') && !lead,
    },
  },
  words: (code) => import(`./messages/${code}.js`),
  startLater: (page) => void Promise.all([import('./offer.js'), speakOf()]).then(([{ offerChallenge }]) => offerChallenge(page, () => { isKnown = true; }), () => {}),
});
