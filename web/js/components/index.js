// The drive screen's elements; other screens load their elements when they are opened.
import './app-bar.js';
import './drive-pad.js';
import './mode-bar.js';
import './teach-panel.js';
import './toast-bar.js';
import './video-view.js';
