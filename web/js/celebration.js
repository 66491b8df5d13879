// Celebrates the moment at which the robot can drive by itself: the panel jumps, and three notes sound.
// The panel does not jump if the person prefers less motion (drive.css), and no notes sound if sound is off.

const NOTES_HZ = [523, 659, 784];
const NOTE_S = 0.14;
const LOUDNESS = 0.08;
const JOY_MS = 1600;

/** @param {Element} panel @param {{sound: boolean}} preferences */
export function celebrate(panel, { sound }) {
  panel.classList.add('joy');
  setTimeout(() => panel.classList.remove('joy'), JOY_MS);
  if (sound) play();
}

function play() {
  const Context = globalThis.AudioContext;
  if (!Context) return;
  const context = new Context();
  NOTES_HZ.forEach((hertz, i) => {
    const [note, volume] = [context.createOscillator(), context.createGain()];
    const beginS = context.currentTime + i * NOTE_S;
    note.frequency.value = hertz;
    volume.gain.setValueAtTime(LOUDNESS, beginS);
    volume.gain.exponentialRampToValueAtTime(0.001, beginS + 2 * NOTE_S);
    note.connect(volume).connect(context.destination);
    note.start(beginS);
    note.stop(beginS + 2 * NOTE_S);
    if (i === NOTES_HZ.length - 1) note.onended = () => context.close();
  });
}
