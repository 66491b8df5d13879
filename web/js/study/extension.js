// Adds studies, whose sessions lead the pilot through their parts.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';
import { followSession } from './session.js';

/** The sentences of a session are loaded only when needed, because few pages are part of a study. */
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
