// Offers the challenge to a pilot whose robot is ready.

import { register } from '../parts.js';

register({
  screens: {
    challenge: {
      load: () => import('./challenge-screen.js'),
      isOffered: ({ readiness, lead }) => readiness?.stage === 'ready' && !lead,
    },
  },
  words: (code) => import(`./messages/${code}.js`),
  startLater: (page) => void import('./offer.js').then(({ offerChallenge }) => offerChallenge(page), () => {}),
});
