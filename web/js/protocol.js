// The messages, the counterpart of server/protocol.py. Pure; described in docs/reference/protocol.md.

export const PROTOCOL_VERSION = 1;
const FRAME_HEADER_BYTES = 24;
const ACKNOWLEDGEMENT_BYTES = 8;
const FRAME = 1;
const ACKNOWLEDGEMENT = 2;
const QUIET = 1;
/** @type {readonly Encoding[]} */
const ENCODINGS = ['jpeg', 'yuyv', 'rgb'];

/** @typedef {'jpeg' | 'yuyv' | 'rgb'} Encoding */
/** @typedef {'stopped' | 'train' | 'autonomous'} Mode */
/**
 * @typedef {object} Picture
 * @property {number} frameId
 * @property {number} capturedMs  on the server's clock
 * @property {Encoding} encoding
 * @property {number} width
 * @property {number} height
 * @property {Uint8Array} data
 * @property {boolean} [quiet]  need not be acknowledged, because a later frame's acknowledgement covers it
 * @property {number} [nonce]  returned with the next command, as proof that the command was sent later
 */
/**
 * The fields of a command that name the frame on the screen and prove when it was seen.
 * @typedef {object} Sight
 * @property {number | null} frame  id of the frame on the screen
 * @property {number | null} [nonce]  the newest nonce that was received
 * @property {number | null} [frameAgeMs]  the age of the frame
 * @property {number | null} [phoneMs]  the part of this age spent on this phone
 */
/**
 * @typedef {object} Prediction
 * @property {number} frame
 * @property {string | null} action
 * @property {number} confidence
 * @property {number} novelty
 * @property {Record<string, number>} probabilities
 * @property {number | null} node
 * @property {number} distance
 * @property {import('./points.js').Point | null} [point]  the proposed steering, on a robot that accepts proportional steering
 * @property {number | null} [spread]  standard deviation of this steering
 */
/**
 * What the robot does and sees; the fields of a `state` message.
 * @typedef {object} RobotState
 * @property {number} server_ms
 * @property {Mode} mode
 * @property {'nobody' | 'pilot' | 'robot'} driven_by
 * @property {string} action
 * @property {import('./points.js').Point | null} [point]  the steering and throttle, if driven proportionally
 * @property {number} speed_scale
 * @property {string | null} stop_reason
 * @property {boolean} emergency
 * @property {string | null} [stop_held_by]  the role that stopped it, if only this role can release it
 * @property {number} stop_number  the number of the newest STOP, by which it is released
 * @property {boolean} asks_pilot
 * @property {string | null} fault
 * @property {string | null} pilot
 * @property {boolean} [wheel_asked]  somebody waits for the pilot's wheel
 * @property {boolean} you_are_pilot
 * @property {number} viewers
 * @property {number | null} frame
 * @property {number | null} frame_age_ms
 * @property {number} cycle_hz
 * @property {'good' | 'slow' | 'capped' | 'not_learning' | 'too_slow'} link  what the link allows
 * @property {boolean} [busy]  the robot's computer is late
 * @property {number | null} pilot_frame_age_ms
 * @property {number} nonce
 * @property {{period_ms: number, age_ms: number, brick_ms?: number | null, limit_ms: number, speed_scale: number}} camera
 * @property {Prediction | null} prediction
 * @property {number | null} agreement
 * @property {number} agreement_frames
 * @property {Record<string, number>} taught
 * @property {number} lessons
 * @property {number} nodes
 * @property {number} max_nodes
 * @property {string} learner
 * @property {number | null} distance_m
 * @property {boolean | null} bumped
 * @property {boolean[]} [bumpers] from left to right
 * @property {number | null} battery
 * @property {{number: number, score: number, reward: number, is_over: boolean}} [game]
 * @property {{x_m: number, y_m: number, heading_rad: number, is_estimate?: boolean} | null} pose
 */

/** A message that violates the protocol; `code` is one of the protocol's error codes. */
export class ProtocolError extends Error {
  /** @param {string} code @param {string} message */
  constructor(code, message) {
    super(message);
    this.code = code;
  }
}

/**
 * Parse one message of `/ws/video`, which is a frame.
 * @param {ArrayBuffer} message
 * @returns {Picture}
 */
export function parsePicture(message) {
  if (message.byteLength < FRAME_HEADER_BYTES) {
    throw new ProtocolError('malformed', 'a frame starts with a header of 24 bytes');
  }
  const view = new DataView(message);
  const encoding = ENCODINGS[view.getUint8(1)];
  if (view.getUint8(0) !== FRAME || !encoding) {
    throw new ProtocolError('unknown_type', 'this is not a frame of a known encoding');
  }
  return {
    frameId: view.getUint32(8, true),
    capturedMs: view.getFloat64(16, true),
    encoding,
    width: view.getUint16(2, true),
    height: view.getUint16(4, true),
    data: new Uint8Array(message, FRAME_HEADER_BYTES),
    quiet: (view.getUint16(6, true) & QUIET) !== 0,
    nonce: view.getUint32(12, true),
  };
}

/**
 * Encode a frame as a message. The page only receives frames; tests and tools need this.
 * @param {Picture} picture
 */
export function encodePicture(picture) {
  const message = new ArrayBuffer(FRAME_HEADER_BYTES + picture.data.length);
  const view = new DataView(message);
  view.setUint8(0, FRAME);
  view.setUint8(1, ENCODINGS.indexOf(picture.encoding));
  view.setUint16(2, picture.width, true);
  view.setUint16(4, picture.height, true);
  view.setUint16(6, picture.quiet ? QUIET : 0, true);
  view.setUint32(8, picture.frameId, true);
  view.setUint32(12, picture.nonce ?? 0, true);
  view.setFloat64(16, picture.capturedMs, true);
  new Uint8Array(message).set(picture.data, FRAME_HEADER_BYTES);
  return message;
}

/** Encode the acknowledgement of a drawn frame. @param {number} frameId */
export function encodeAcknowledgement(frameId) {
  const message = new ArrayBuffer(ACKNOWLEDGEMENT_BYTES);
  const view = new DataView(message);
  view.setUint8(0, ACKNOWLEDGEMENT);
  view.setUint32(4, frameId, true);
  return message;
}

/** Return the number of an acknowledged frame. @param {ArrayBuffer} message */
export function parseAcknowledgement(message) {
  if (message.byteLength !== ACKNOWLEDGEMENT_BYTES) {
    const code = message.byteLength > ACKNOWLEDGEMENT_BYTES ? 'too_large' : 'malformed';
    throw new ProtocolError(code, 'an acknowledgement has 8 bytes');
  }
  const view = new DataView(message);
  if (view.getUint8(0) !== ACKNOWLEDGEMENT) {
    throw new ProtocolError('unknown_type', 'this socket receives acknowledgements only');
  }
  return view.getUint32(4, true);
}

/**
 * Encode the move that the pilot holds, with the frame on the screen; also serves as a heartbeat.
 * @param {{held: string | null, seq: number, steering?: number, throttle?: number} & Sight} command
 */
export function encodeDrive({ held, steering, throttle, frame, seq, nonce, frameAgeMs, phoneMs }) {
  return JSON.stringify({
    type: 'drive', held, steering, throttle, frame, seq, nonce: nonce ?? undefined,
    frame_age_ms: frameAgeMs ?? undefined, phone_ms: phoneMs ?? undefined,
  });
}

/** Encode a request to change the mode. @param {Mode} mode @param {number} seq @param {Sight} [sight] */
export function encodeMode(mode, seq, { frame, nonce } = { frame: null }) {
  return JSON.stringify({ type: 'mode', mode, seq, frame: frame ?? undefined, nonce: nonce ?? undefined });
}

/** Encode the release of the emergency stop with this number, which the state contains. @param {number} stopNumber */
export function encodeRelease(stopNumber) {
  return JSON.stringify({ type: 'release', stop_number: stopNumber });
}

/** @typedef {'stop' | 'take' | 'yield' | 'idle' | 'watch'} Word */
/** @param {Word} type */
export function encodeWord(type) {
  return JSON.stringify({ type });
}

/** @param {number} clientMs */
export function encodePing(clientMs) {
  return JSON.stringify({ type: 'ping', client_ms: clientMs });
}

/**
 * Read one message of `/ws/drive`; unknown fields are passed on and may be ignored.
 * @param {string} text
 * @returns {{type: string} & Record<string, any>}
 */
export function parseWords(text) {
  let message;
  try {
    message = JSON.parse(text);
  } catch {
    message = null;
  }
  if (typeof message !== 'object' || message === null || typeof message.type !== 'string') {
    throw new ProtocolError('malformed', 'a message is one JSON object with a type');
  }
  return message;
}
