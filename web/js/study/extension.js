// The session of a study leads the pilot through its parts.

import { register } from '../parts.js';
import { followSession } from './session.js';

register({
  screens: {
    study: {
      load: () => import('./study-screen.js'),
      isOffered: ({ lead }) => Boolean(lead),
      settings: { title: 'settings.studies', hint: 'settings.studies_hint' },
    },
  },
  words: (code) => import(`./messages/${code}.js`),
  start: followSession,
});
