// The extensions' parts of the page, one line each, like entry points in Python.
import './board/extension.js';
import './challenge/extension.js';
import './study/extension.js';
