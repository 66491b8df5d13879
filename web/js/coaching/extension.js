// Adds the screens that show what the robot has learned, explain its choices, rate the teaching, and undo teaching.

import { fetchWords } from '../i18n.js';
import { register } from '../parts.js';

/** @param {() => Promise<unknown>} load @param {boolean} inMenu */
const screen = (load, inMenu = false) => ({
  load: () => Promise.all([load(), fetchWords((code) => import(`./screens/messages/${code}.js`))]),
  isOffered: () => inMenu,
});

const AGAIN_MS = 3000;

/** Fetch the module that says what the training still lacks, again and again until it is there. @param {import('../store.js').Store} store */
const follow = (store) => import('./readiness.js').then(({ followReadiness }) => followReadiness(store), () => { setTimeout(() => follow(store), AGAIN_MS); });

register({
  screens: {
    gallery: screen(() => import('./gallery-screen.js'), true),
    teaching: screen(() => import('./teaching-screen.js'), true),
    why: screen(() => import('./why-screen.js')),
    undo: screen(() => import('./undo-screen.js')),
  },
  words: (code) => import(`./messages/${code}.js`),
  startLater: ({ store }) => void follow(store),
});
