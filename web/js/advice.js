// Advice for the pilot: one sentence about the robot's state, and the next step. Pure.

/** @typedef {import('./store.js').PageState} PageState */
/**
 * @typedef {{kind: string, move: string | null, instead: string | null, have: number, need: number,
 *   distance_m: number | null, png?: string | null}} Gap
 */
/**
 * @typedef {{stage: 'teach' | 'try' | 'ready', alone_s: number, alone_needed_s: number, unknown_share: number,
 *   moves: string[], missing: Gap[]}} Readiness
 */
/** @typedef {{key: string, values?: Record<string, string | number>, step?: string, level: 'info' | 'ask' | 'stop'}} Advice */

const FEW_EXAMPLES = 60;
const USED_SHARE = 0.03; // a move with a smaller share of the examples counts as a slip of the thumb

/**
 * The moves that this pilot uses: all moves that were taught, except slips of the thumb.
 * @param {Record<string, number>} taught
 * @returns {string[]}
 */
export function usedMoves(taught) {
  const total = Object.values(taught).reduce((sum, n) => sum + n, 0);
  return Object.keys(taught).filter((move) => taught[move] > 0 && taught[move] >= USED_SHARE * total);
}

/**
 * The key of the text that says who drives; a robot that stands still and asks for help is not driving.
 * @param {import('./protocol.js').RobotState | null} robot
 */
export function whoDrives(robot) {
  if (robot?.asks_pilot && robot.mode === 'autonomous' && robot.action === 'stop') return 'asks';
  const by = robot?.driven_by ?? 'nobody';
  if (!robot?.you_are_pilot) return by === 'pilot' ? 'other' : by;
  return by === 'nobody' && robot.mode === 'train' ? 'waiting' : by;
}

/**
 * The most urgent advice; null if all is well.
 * @param {PageState} page
 * @returns {Advice | null}
 */
export function urgentAdvice(page) {
  const robot = page.robot;
  if (page.link !== 'open' || !robot) {
    if (page.link !== 'lost') return { key: 'connecting', level: 'info' };
    return wayAdvice(page);
  }
  if (robot.stop_held_by) return { key: `stopped_by.${robot.stop_held_by}`, level: 'stop' };
  const elsewhere = robot.you_are_pilot ? null : wheelElsewhere(page);
  // Only the pilot with the wheel can release the emergency stop; the robot refuses a release by others.
  if (robot.emergency) return { key: 'emergency', step: elsewhere ? elsewhere.step : 'release', level: 'stop' };
  if (elsewhere) return elsewhere;
  if (page.wheelAsked) return { key: 'wheel_asked', step: 'yield', level: 'ask' };
  if (robot.fault) return { key: 'fault', values: { fault: robot.fault }, level: 'stop' };
  // If the part that an extension led is over, it does not matter why the robot stands still.
  if (page.lead?.isOver) return page.lead.ask(robot);
  // The text of the extension that leads the pilot already says which mode to choose.
  if (page.localStop === 'wheel' && robot.mode === 'stopped' && !page.lead) return { key: 'local.wheel', level: 'ask' };
  if (page.localStop && page.localStop !== 'wheel') return { key: `local.${page.localStop}`, level: 'stop' };
  if (page.notice === 'start_stale') return { key: page.notice, level: 'stop' };
  if (robot.mode === 'stopped' && robot.stop_reason && robot.stop_reason !== 'pilot_asked') {
    if (robot.stop_reason === 'link_slow' && isComputer(page)) return { key: 'busy.stopped', level: 'stop' };
    return { key: `stop.${robot.stop_reason}`, level: 'stop' };
  }
  if (robot.asks_pilot && robot.mode === 'autonomous') {
    if (robot.stop_reason === 'needs_help') return { key: 'asks_help', level: 'ask' };
    return { key: robot.lessons ? 'asks' : 'asks_empty', level: 'ask' };
  }
  const lag = lagAdvice(page);
  if (lag) return lag;
  const late = robot.mode === 'stopped' ? 'good' : lateness(robot);
  if (late !== 'good') return { key: isComputer(page) ? `busy.${late}` : `link.${late}`, level: 'info' };
  const asked = page.lead?.ask(robot);
  if (asked) return asked;
  if (page.notice) return { key: page.notice, level: 'info' };
  if (page.hint) return { key: page.hint === 'correct' && page.hasKeys ? 'hint.correct_keys' : `hint.${page.hint}`, step: 'hint', level: 'info' };
  return null;
}

/**
 * Say why there is no link. The text says what the robot does only if the robot has reported it: without its
 * pilot the robot stops, unless somebody else has taken the wheel. @param {PageState} page @returns {Advice}
 */
function wayAdvice({ robot, way, isWatching }) {
  if (way?.kind === 'blocked' || way?.kind === 'cut') {
    const step = isWatching ? undefined : 'watch';
    return { key: `way.${way.kind}.${way.robot}`, level: 'ask', ...(step ? { step } : {}) };
  }
  if (way?.kind === 'silent') return { key: robot && !robot.you_are_pilot ? 'searching' : 'out_of_reach', level: 'info' };
  if (way?.kind === 'refused') return { key: 'fault', values: { fault: way.words ?? '' }, level: 'info' };
  return { key: way && way.kind !== 'checking' ? `way.${way.kind}` : 'searching', level: 'info' };
}

/**
 * The parts of the age of the picture on the screen, in milliseconds: `camera` until the picture reaches the
 * robot's loop (`brick` is a brick's part of it), `link` from the loop to this phone, `phone` on the phone. @param {PageState}
 * page @returns {{camera: number, brick?: number, link: number, phone: number} | null}  null until it is
 * known
 */
export function ageParts({ robot, drawnAgeMs, drawingMs }) {
  if (!robot?.camera || drawnAgeMs === null) return null;
  const phone = Math.min(Math.max(drawingMs, 0), drawnAgeMs);
  const camera = Math.min(robot.camera.age_ms, drawnAgeMs - phone);
  const link = Math.round(drawnAgeMs - phone - camera);
  const brick = robot.camera.brick_ms == null ? null : Math.min(robot.camera.brick_ms, camera);
  if (brick === null) return { camera: Math.round(camera), link, phone: Math.round(phone) };
  return { camera: Math.round(camera - brick), brick: Math.round(brick), link, phone: Math.round(phone) };
}

/** True if delays are due to the computer, not to the link. @param {PageState} page */
const isComputer = ({ robot, isLocal }) => isLocal || Boolean(robot?.busy);

/** The grade of the link, but at least `capped` if the robot's computer is busy, because the robot then already drives slower. @param {import('./protocol.js').RobotState} robot */
const lateness = ({ link, busy }) => busy && (link === 'good' || link === 'slow') ? 'capped' : link ?? 'good';

const OLD_MS = 200;

/** Round a time, because screen readers read out each change. @param {number} ms */
const inHundreds = (ms) => ({ ms: Math.max(100, Math.round(ms / 100) * 100) });

/** Advice about late pictures if their cause is not the link; null if there is no such cause. @param {PageState} page @returns {Advice | null} */
function lagAdvice(page) {
  const { robot } = page;
  if (!robot?.camera || robot.mode === 'stopped') return null;
  const parts = ageParts(page);
  const camera = Math.round(robot.camera.age_ms);
  const brick = Math.round(robot.camera.brick_ms ?? 0);
  if (robot.camera.speed_scale < 1 && 2 * brick > camera) return { key: 'lag.brick', values: inHundreds(brick), level: 'info' };
  if (robot.camera.speed_scale < 1) return { key: 'lag.camera', values: inHundreds(camera), level: 'info' };
  if (parts && parts.phone > OLD_MS && parts.phone > parts.link) return { key: 'lag.phone', values: inHundreds(parts.phone), level: 'info' };
  return null;
}

/** @param {PageState} page @returns {Advice} */
function wheelElsewhere(page) {
  if (page.role === 'viewer') return { key: 'viewer', level: 'info' };
  if (page.robot?.pilot === null) return { key: 'wheel_free', step: 'take', level: 'info' };
  if (page.wheelWaiting) return { key: 'wheel_waiting', level: 'info' };
  return { key: 'wheel_taken', step: 'take', level: 'info' };
}

/** @typedef {{key: string, move?: string, left?: number, left_s?: number, have?: number, need?: number, n?: number, of?: number, metres?: string}} Told */

/**
 * The text while nothing is urgent: an extension's text about its progress, the reason why the robot now has to drive by itself for longer, or the most useful advice; null before the first state. @param {PageState} page @returns {Told | null}
 */
export function whatToSay({ robot, lead, readiness, setback, told }) {
  if (!robot) return null;
  if (lead?.told) return lead.told;
  if (told) return told;
  if (setback && robot.mode === 'autonomous') return { key: `setback.${setback}` };
  return teachingAdvice(robot, readiness);
}

/** @type {Record<string, import('./protocol.js').Mode>} for each advice, the mode that it asks the pilot to choose */
const ASKED_FOR = {
  'advice.start': 'train', 'advice.more': 'train', 'advice.try': 'autonomous', 'advice.ready': 'autonomous',
  'hint.teach': 'train', choose_first: 'train',
};

/** The mode whose button should be pressed now, if any. @param {PageState} page */
export function modeToPress(page) {
  const key = urgentAdvice(page)?.key ?? whatToSay(page)?.key ?? '';
  const mode = ASKED_FOR[key] ?? null;
  return mode === page.robot?.mode ? null : mode;
}

/**
 * The most useful advice now. The advice follows the robot's readiness, not the agreement, which most pilots reach long before their robot can drive by itself. @param {import('./protocol.js').RobotState} robot @param
 * {Readiness | null} readiness @returns {{key: string, move?: string, left?: number,
 * have?: number, need?: number}}
 */
export function teachingAdvice(robot, readiness) {
  const { mode, lessons } = robot;
  if (mode === 'stopped' && lessons === 0) return { key: 'advice.start' };
  if (lessons === 0) return { key: 'advice.first' };
  const used = usedMoves(robot.taught);
  if (mode !== 'autonomous' && lessons >= FEW_EXAMPLES && used.length < 2) return { key: used[0] === 'forward' ? 'advice.turn' : 'advice.go_on' };
  if (!readiness) return { key: mode === 'autonomous' ? 'advice.watch' : 'advice.go_on' };
  const { stage, missing, alone_s: alone, alone_needed_s: needed } = readiness;
  const left = Math.max(1, Math.ceil((needed - alone) / 5)) * 5; // in steps of five, because screen readers read out each change
  if (mode === 'autonomous') {
    if (stage === 'ready') return { key: 'advice.can', left: needed };
    return { key: stage === 'try' && alone >= 1 ? 'advice.trial' : 'advice.watch', left };
  }
  if (stage === 'ready') return { key: 'advice.ready' };
  if (stage === 'try') return { key: 'advice.try' };
  const [first] = missing;
  if (first?.kind === 'rare_move' && first.move) return { key: 'advice.rare', move: first.move, have: first.have, need: first.need };
  if (first?.kind === 'too_short' && mode === 'stopped') return { key: 'advice.more', left: Math.max(1, Math.ceil(first.need - first.have)) };
  return { key: 'advice.go_on' };
}
