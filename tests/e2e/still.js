// Shows every state and every notice of the drive screen, one after the other, and lists what moves;
// see test_holds_still.py. The states are made from the program's own enumerations; `said` lists the
// sentences that were shown, and MEASURE is replaced by boxes.js.
async ({ stopReasons, links, phases, moves, hasStick, seed }) => {
  const measure = MEASURE;
  const { page } = document.querySelector('app-bar');
  const { store } = page;
  const { HINTS } = await import('/js/hints.js');
  const { leadOf } = await import('/js/study/session.js');
  page.follow = () => {}; // ignore the real robot's states
  page.connection.dispatchEvent = () => true;
  const taught = Object.fromEntries(moves.map((move, i) => [move, 150 + i]));
  const calm = {
    ...store.state.robot, mode: 'stopped', driven_by: 'nobody', action: 'stop', stop_reason: null, emergency: false, fault: null,
    asks_pilot: false, link: 'good', busy: false, you_are_pilot: true, pilot: 'c1', lessons: 12345, agreement: 0.93, agreement_frames: 100, taught, battery: 0.1,
    distance_m: 1.23, bumped: true, camera: null, stop_held_by: null,
    point: hasStick ? { steering: -0.4, throttle: 0.5 } : null,
    prediction: { ...store.state.robot.prediction, point: hasStick ? { steering: 0.9, throttle: 0.5 } : null, spread: hasStick ? 0.3 : null, action: moves[0], probabilities: Object.fromEntries(moves.map((move) => [move, 1 / moves.length])) },
  };
  const clean = {
    ...store.state, takesPoints: hasStick, hasStick, isLocal: false, link: 'open', way: null, robot: calm, moves, held: null, role: 'pilot', localStop: null, notice: null, hint: null, toast: null,
    lead: null, told: null, readiness: null, setback: null, wheelAsked: false, wheelWaiting: false, pictureAgeMs: 30, drawnAgeMs: 30, drawingMs: 3,
  };
  const ready = (stage, more = {}) => ({ stage, alone_s: 12, alone_needed_s: 45, unknown_share: 0, moves, missing: [], ...more });
  const gap = (kind, move = null) => ({ kind, move, instead: null, have: 12, need: 40, distance_m: null });
  const study = (kind, more = {}) => leadOf({ step: 'drive', position: 10, of: 12, kind, mode: kind === 'teach' ? 'train' : 'autonomous', left_s: 123, ...more });
  const drives = ['train', 'autonomous'];
  const states = [
    ...['offline', 'gateway', 'full', 'foreign', 'silent', 'starting'].map((kind) => ({ link: 'lost', way: { kind, robot: 'unknown' } })),
    ...['blocked', 'cut'].flatMap((kind) => ['stands', 'driven', 'alone'].map((robot) => ({ link: 'lost', way: { kind, robot } }))),
    {}, { link: 'lost' }, { link: 'lost', robot: { you_are_pilot: false } }, { link: 'connecting' }, { robot: { stop_held_by: 'teacher' } }, { robot: { emergency: true } },
    { role: 'viewer', robot: { you_are_pilot: false } }, { robot: { you_are_pilot: false, pilot: null } },
    { robot: { you_are_pilot: false, pilot: 'c9' } }, { wheelWaiting: true, robot: { you_are_pilot: false, pilot: 'c9' } },
    { wheelAsked: true }, { robot: { fault: 'The left motor does not answer. Check its cable at port B, then choose a mode.' } },
    ...['hidden', 'elsewhere', 'wheel'].map((localStop) => ({ localStop })),
    ...['start_stale', 'choose_first'].map((notice) => ({ notice })),
    ...stopReasons.filter((reason) => reason !== 'needs_help').map((reason) => ({ robot: { stop_reason: reason } })),
    ...['needs_help', null].map((reason) => ({ robot: { mode: 'autonomous', asks_pilot: true, stop_reason: reason } })),
    { robot: { mode: 'autonomous', asks_pilot: true, lessons: 0 } },
    ...drives.flatMap((mode) => links.flatMap((link) => [true, false].map((isLocal) => ({ isLocal, robot: { mode, link } })))),
    { isLocal: true, robot: { stop_reason: 'link_slow' } },
    ...drives.map((mode) => ({ robot: { mode, busy: true } })), { robot: { busy: true, stop_reason: 'link_slow' } },
    ...[0, 200].map((brick) => ({ robot: { mode: 'train', camera: { age_ms: 300, brick_ms: brick, speed_scale: 0.5 } }, pictureAgeMs: 400, drawnAgeMs: 400 })),
    { robot: { mode: 'train', camera: { age_ms: 30, speed_scale: 1 } }, pictureAgeMs: 400, drawnAgeMs: 400, drawingMs: 350 },
    ...HINTS.flatMap((hint) => [true, false].map((hasKeys) => ({ hint, hasKeys }))),
    { toast: { text: 'It was relabelled, and this sentence is as long as any that a toast has to say.', step: { label: 'Undo', act() {} } } },
    { toast: { text: 'The model could not be saved: the disk is full.', step: null } },
    { lead: study(null, { step: 'questions', mode: null }) },
    ...phases.flatMap((kind) => ['stopped', ...drives].map((mode) => ({ robot: { mode }, lead: study(kind) }))),
    ...[{ key: 'challenge.armed' }, { key: 'challenge.left', n: 2, of: 3, metres: '12.3', left_s: 60 }].map((told) => ({ told, robot: { mode: 'autonomous' }, readiness: ready('ready') })),
    ...['stopped', ...drives].flatMap((mode) => [
      { robot: { mode, lessons: 0 } }, { robot: { mode, agreement: null } }, { robot: { mode, taught: { [moves[0]]: 300 } } },
      ...['teach', 'try', 'ready'].map((stage) => ({ robot: { mode }, readiness: ready(stage) })),
      ...moves.map((move) => ({ robot: { mode }, readiness: ready('teach', { missing: [gap('rare_move', move)] }) })),
      { robot: { mode }, readiness: ready('teach', { missing: [gap('too_short')] }) },
    ]),
    { robot: { mode: 'autonomous' }, readiness: ready('try', { alone_s: 0 }) },
    ...['corrected', 'pushed', 'helpless', 'unknown_view'].map((setback) => ({ robot: { mode: 'autonomous' }, setback })),
    ...moves.flatMap((move) => [
      { held: move, robot: { mode: 'train', driven_by: 'pilot', action: move } },
      { robot: { mode: 'autonomous', driven_by: 'robot', action: move, bumpers: [true, false] } },
    ]),
  ];
  // The order depends on the seed, so that over several seeds each state follows many others.
  let chance = seed;
  const random = () => (chance = (chance * 48271) % 2147483647) / 2147483647;
  for (let i = states.length - 1; i > 0; i -= 1) {
    const j = Math.floor(random() * (i + 1));
    [states[i], states[j]] = [states[j], states[i]];
  }
  const controls = () => [...document.querySelectorAll('button, a')].filter((e) => e.checkVisibility({ visibilityProperty: true }));
  const name = (e) => (e ? `${e.localName}.${e.className} "${(e.textContent || e.ariaLabel || '').trim().slice(0, 24)}"` : 'nothing');
  const controlAt = ([x, y]) => document.elementFromPoint(x, y)?.closest('button, a') ?? null;
  const pointsOf = (e) => {
    const { left, top, width, height } = e.getBoundingClientRect();
    // The middle, and a point near each corner; more points would make the test slow.
    const shares = [[0.5, 0.5], ...[0.15, 0.85].flatMap((u) => [0.15, 0.85].map((v) => [u, v]))];
    return shares.map(([u, v]) => [left + u * width, top + v * height]);
  };
  const boxOf = (e) => {
    const { left, top, width, height } = e.getBoundingClientRect();
    return [left, top, width, height];
  };
  const places = () => {
    const fixed = document.querySelectorAll('.picture, teach-panel, mode-bar, mode-bar button, .move, .stick, .undo, button.stop.shown, app-bar button, .like');
    return [...fixed].map((e) => [name(e), boxOf(e)]);
  };
  const stopFaults = () => {
    const stops = [...document.querySelectorAll('button.stop')].filter((e) => e.checkVisibility());
    if (stops.length !== 1) return [`${stops.length} STOP buttons`];
    const [left, top, width, height] = boxOf(stops[0]);
    if (left < 0 || top < 0 || left + width > innerWidth || top + height > innerHeight) return [`STOP leaves the screen: ${[left, top, width, height]}`];
    if (width < 44 || height < 44) return [`STOP is small: ${width}x${height}`];
    return pointsOf(stops[0]).every((at) => controlAt(at) === stops[0]) ? [] : ['STOP is covered'];
  };
  const aimsNow = () => controls().flatMap((e) => pointsOf(e).map((at) => [at, e]));
  const isSame = (one, two) => one.length === two.length
    && one.every(([[x, y], e], i) => e === two[i][1] && x === two[i][0][0] && y === two[i][0][1]);
  const show = (change) => store.set({ ...clean, ...change, robot: { ...calm, ...change.robot } });
  const passTime = () => document.querySelectorAll('.fresh').forEach((e) => e.classList.remove('fresh'));
  const found = [];
  const said = new Set();
  const scrolled = new Set();
  store.set({ moves: [...moves] });
  show({});
  for (let i = 0; i < 2; i += 1) await new Promise(requestAnimationFrame); // until the browser has laid the page out
  await new Promise((done) => setTimeout(done, 50));
  const first = places();
  let aims = []; // the points at which a finger aims, each with its control
  for (const change of states) {
    const note = (fault) => found.push(`${JSON.stringify(change).slice(0, 140)}: ${fault}`);
    show(change);
    // A finger that aimed before the change must hit the same control or nothing.
    const next = aimsNow();
    // If no control has appeared, vanished or moved, no tap can hit another one.
    if (!isSame(aims, next)) for (const [at, was] of aims) {
      const is = controlAt(at);
      if (is && is !== was && is.isConnected) note(`a tap for ${name(was)} lands on ${name(is)}`);
    }
    aims = next;
    passTime();
    stopFaults().forEach(note);
    places().forEach(([what, box], i) => {
      const moved = box.map((x, k) => Math.abs(x - first[i][1][k]));
      if (Math.max(...moved) > 1) note(`${what} moved from ${first[i][1].map(Math.round)} to ${box.map(Math.round)}`);
    });
    measure().forEach(note);
    for (const e of document.querySelectorAll('.advice, .notice p')) if (e.textContent && e.checkVisibility()) {
      said.add(e.textContent);
      if (!change.toast && !change.robot?.fault && e.scrollHeight > e.clientHeight + 1) scrolled.add(e.textContent);
    }
  }
  return { found: [...new Set(found)], said: [...said], scrolled: [...scrolled], states: states.length };
}
