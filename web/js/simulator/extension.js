// The places of a simulated robot, in the settings.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

register({
  sections: {
    settings: async () => {
      const [{ showPlaces }] = await Promise.all([import('./places.js'), fetchWords((code) => import(`./places/messages/${code}.js`))]);
      return showPlaces;
    },
  },
});
