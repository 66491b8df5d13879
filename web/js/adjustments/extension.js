// The corrections of a robot whose wiring or camera differs from its driver's default, in the settings.

import { register } from '../parts.js';

register({ sections: { settings: async () => (await import('./corrections.js')).showCorrections } });
