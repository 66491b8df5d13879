// Shows on the page of a class's robot that the teacher has stopped the robot.

import { register } from '../parts.js';

register({ words: (code) => import(`./messages/${code}.js`) });
