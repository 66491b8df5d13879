// Adds the choice of a simulated robot's place to the settings.

import { register } from '../parts.js';

register({ sections: { settings: async () => (await import('./places.js')).showPlaces } });
