// Adds the screen with the models that are saved on the robot.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

register({
  screens: {
    home: {
      load: () => Promise.all([import('./home-screen.js'), fetchWords((code) => import(`./models/messages/${code}.js`))]),
      isOffered: () => true,
    },
  },
  words: (code) => import(`./messages/${code}.js`),
});
