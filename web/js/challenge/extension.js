// Offers the challenge to a pilot whose robot is ready.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

const speakOf = () => fetchWords((code) => import(`./tries/messages/${code}.js`));

let isKnown = false; // once offered, the challenge stays in the menu, because its screen shows the tries even if the robot is no longer ready

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
