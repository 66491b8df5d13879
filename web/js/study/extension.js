// The session of a study leads the pilot through its parts.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';
import { followSession } from './session.js';

/** Few pages are in a study: its sentences come when they are needed. */
const speakOf = () => fetchWords((code) => import(`./session/messages/${code}.js`));

register({
  screens: {
    study: {
      load: () => Promise.all([import('./study-screen.js'), speakOf()]),
      isOffered: ({ lead }) => Boolean(lead),
      settings: { title: 'settings.studies', hint: 'settings.studies_hint' },
    },
  },
  words: (code) => import(`./messages/${code}.js`),
  start: (page) => followSession(page, speakOf),
});
