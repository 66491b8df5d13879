// A study's session, which leads the pilot through its parts.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';
import { followSession } from './session.js';

/** Few pages are part of a study, so its sentences are loaded when needed. */
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
