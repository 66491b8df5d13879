// Shows the gaps in the training that have to be closed before the robot can drive by itself, each with a picture of its place.

import { fill, h } from '../dom.js';
import { tellGap, tellStage } from './readiness.js';

/** Draw the readiness into `place`. @param {Element} place @param {import('../advice.js').Readiness} readiness */
export function drawReadiness(place, readiness) {
  const { stage, alone_s: alone, alone_needed_s: needed, missing } = readiness;
  const done = h('i');
  done.style.transform = `scaleX(${stage === 'ready' ? 1 : Math.min(1, alone / needed)})`;
  fill(place,
    h('p', { class: `stage ${stage}`, role: 'status' }, tellStage(readiness)),
    stage === 'teach' ? null : h('span', { class: 'track robots', 'aria-hidden': 'true' }, done),
    missing.length ? h('ul', { class: 'gaps' }, ...missing.map(makeGap)) : null);
}

/** @param {import('../advice.js').Gap} gap */
function makeGap(gap) {
  return h('li', {},
    gap.png ? h('img', { class: 'pixels', src: `data:image/png;base64,${gap.png}`, alt: '', width: 80, height: 60 }) : null,
    h('span', {}, tellGap(gap)));
}
