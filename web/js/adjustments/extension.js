// The corrections of a robot whose wiring or camera differs from its driver's default, in the settings.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

register({
  sections: {
    settings: async () => {
      const [{ showCorrections }] = await Promise.all([import('./corrections.js'), fetchWords((code) => import(`./corrections/messages/${code}.js`))]);
      return showCorrections;
    },
  },
});
