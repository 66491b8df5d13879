// Loads the elements of the drive screen; other screens load theirs when they are opened.
import './app-bar.js';
import './drive-pad.js';
import './mode-bar.js';
import './teach-panel.js';
import './toast-bar.js';
import './video-view.js';
