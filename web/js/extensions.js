// Imports the extensions' parts of the page, each by one line. The lines are like entry points in Python.
import './coaching/extension.js';
import './board/extension.js';
import './challenge/extension.js';
import './library/extension.js';
import './recordings/extension.js';
import './simulator/extension.js';
import './study/extension.js';
import './adjustments/extension.js';
