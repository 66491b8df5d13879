// Adds the recordings of the robot's drives to the screen of its models.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

register({
  sections: {
    home: async () => {
      const [{ showRecordings }] = await Promise.all([import('./recordings.js'), fetchWords((code) => import(`./list/messages/${code}.js`))]);
      return showRecordings;
    },
  },
});
