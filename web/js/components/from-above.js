// The world from above: the room, the robot's path, and the places where the robot asked for help, pushed against something or was corrected.
// The path is amber where the pilot drove, and blue where the robot drove.
// A path is exact if the robot knows its place.
// If the robot does not know its place, the path is estimated from the wheels' counts, and labelled as an estimate.

import { ask } from '../api.js';
import { fill, h, svg } from '../dom.js';
import { t } from '../i18n.js';

/**
 * @typedef {{pose: ([number, number, number] | null)[], driven_by: (string | null)[], asks_pilot: boolean[],
 *   intervention: boolean[], bumped: boolean[]}} Path
 */
/** @typedef {{width_m: number, depth_m: number, things: {moves?: boolean, shape: string, x_m: number, y_m: number, width_m: number, depth_m: number, heading_rad: number}[]}} World */

const MARGIN_M = 0.1;
/** @type {[keyof Path, string][]} */
const MARKS = [['asks_pilot', 'asked'], ['bumped', 'pushed'], ['intervention', 'corrected']];

/** The world around the robot; null if nobody knows it. @returns {Promise<World | null>} */
export async function fetchWorld() {
  return (await ask('GET', 'api/world').catch(() => ({ world: null }))).world;
}

/**
 * Draw a path into `place`. An event `moment`, whose detail is the index of a point, puts the robot's symbol there.
 * @param {HTMLElement} place @param {Path} path @param {boolean} [isEstimate]  computed from the wheels' counts
 */
export async function drawFromAbove(place, path, isEstimate = false) {
  const poses = path.pose;
  if (!poses.some(Boolean)) return;
  const world = isEstimate ? null : await fetchWorld();
  const [left, bottom, right, top] = bounds(poses, world);
  // North is up: y grows upwards in the world and downwards on the screen.
  const ground = svg('g', { transform: 'scale(1 -1)' });
  if (world) ground.append(...room(world));
  for (const who of ['pilot', 'robot']) ground.append(svg('path', { class: `way ${who}`, d: way(path, who) }));
  const counts = MARKS.map(([field, kind]) => {
    const places = begins(/** @type {boolean[]} */ (path[field])).flatMap((i) => (poses[i] ? [poses[i]] : []));
    ground.append(...places.map(([x, y]) => mark(kind, x, y)));
    return [kind, places.length];
  });
  const robot = makeRobot();
  ground.append(robot);
  const label = t('above.label', Object.fromEntries(counts));
  const picture = svg('svg', {
    viewBox: `${left} ${-top} ${right - left} ${top - bottom}`, role: 'img', 'aria-label': label, class: 'above',
  }, ground);
  fill(place, /** @type {any} */ (picture), h('p', { class: 'under' }, isEstimate ? `${t('above.estimate')} ${label}` : label));
  const stand = (/** @type {number} */ index) => standAt(robot, poses[index]);
  place.addEventListener('moment', (event) => stand(/** @type {CustomEvent} */ (event).detail));
  stand(poses.findIndex(Boolean));
}

/** The robot's symbol, which points in its viewing direction. */
export const makeRobot = () => svg('path', { class: 'body', d: 'M.09 0L-.06 .06V-.06Z' });

/** @param {Element} robot @param {readonly number[] | null} pose */
export function standAt(robot, pose) {
  if (pose) robot.setAttribute('transform', `translate(${pose[0]} ${pose[1]}) rotate(${(pose[2] * 180) / Math.PI})`);
}

/** @param {World} world */
export function room({ width_m: width, depth_m: depth, things }) {
  return [
    svg('rect', { class: 'floor', x: 0, y: 0, width, height: depth }),
    ...things.map((thing) => thing.shape === 'cylinder'
      ? svg('circle', { class: 'thing', cx: thing.x_m, cy: thing.y_m, r: thing.width_m / 2 })
      : svg('rect', {
        class: 'thing', x: -thing.width_m / 2, y: -thing.depth_m / 2, width: thing.width_m, height: thing.depth_m,
        transform: `translate(${thing.x_m} ${thing.y_m}) rotate(${(thing.heading_rad * 180) / Math.PI})`,
      })),
  ];
}

/** Left, bottom, right and top of the visible area. @param {Path['pose']} poses @param {World | null} world */
export function bounds(poses, world) {
  const xs = poses.flatMap((pose) => (pose ? [pose[0]] : []));
  const ys = poses.flatMap((pose) => (pose ? [pose[1]] : []));
  if (world) { xs.push(0, world.width_m); ys.push(0, world.depth_m); }
  const least = (/** @type {number[]} */ all) => all.reduce((a, b) => Math.min(a, b)) - MARGIN_M;
  const most = (/** @type {number[]} */ all) => all.reduce((a, b) => Math.max(a, b)) + MARGIN_M;
  return [least(xs), least(ys), most(xs), most(ys)];
}

/** The parts of the path that the pilot or the robot drove. @param {Pick<Path, 'pose' | 'driven_by'>} path @param {string} who */
export function way({ pose, driven_by: by }, who) {
  let d = '';
  for (let i = 1; i < pose.length; i += 1) {
    const [a, b] = [pose[i - 1], pose[i]];
    if (!a || !b || by[i] !== who) continue;
    const goesOn = d && by[i - 1] === who && pose[i - 2];
    d += `${goesOn ? '' : `M${a[0].toFixed(3)} ${a[1].toFixed(3)}`}L${b[0].toFixed(3)} ${b[1].toFixed(3)}`;
  }
  return d;
}

/** The indices at which a flag becomes true. @param {boolean[]} flags */
export function begins(flags) {
  return flags.flatMap((flag, i) => (flag && !flags[i - 1] ? [i] : []));
}

/** Draw an event. Each kind of event has its own symbol, so that they can be told apart without colours. @param {string} kind @param {number} x @param {number} y */
export function mark(kind, x, y) {
  /** @type {Record<string, string>} */
  const signs = { asked: 'M0 .05V-.02M0 -.05V-.055', pushed: 'M-.04 -.04L.04 .04M-.04 .04L.04 -.04', corrected: 'M-.045 0A.045 .045 0 1 0 .045 0A.045 .045 0 1 0 -.045 0' };
  return svg('path', { class: `mark ${kind}`, d: signs[kind], transform: `translate(${x} ${y})` });
}
