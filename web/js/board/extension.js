// Shows on a class robot's page that the teacher has stopped it.

import { register } from '../parts.js';

register({ words: (code) => import(`./messages/${code}.js`) });
