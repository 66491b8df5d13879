// Adds to the settings the corrections of a robot whose wiring or camera differs from what its driver expects.

import { register } from '../parts.js';

register({ sections: { settings: async () => (await import('./corrections.js')).showCorrections } });
