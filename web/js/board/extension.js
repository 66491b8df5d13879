// A robot in a class says on its own page who has stopped it.

import { register } from '../parts.js';

register({ words: (code) => import(`./messages/${code}.js`) });
