// The places of a simulated robot, in the settings.

import { register } from '../parts.js';

register({ sections: { settings: async () => (await import('./places.js')).showPlaces } });
