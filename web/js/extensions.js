// The extensions' parts of the page, as entry points are those of the programs: one line each.
import './board/extension.js';
import './challenge/extension.js';
import './study/extension.js';
