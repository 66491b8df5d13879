#!/usr/bin/env bash
# gamepad-wrapper 1.3.4 (npm): a trigger that was not pulled fully is never released.
#
# Guess before running: getButtonDown is true once when a trigger is pulled, and getButtonUp is true once when it is
# released. The README says that the library compares whether the trigger was down in the previous frame and is down
# now.
# Outcome: wrong. The trigger counts as down as soon as it leaves 0, but as up only when it leaves 1. A trigger that
# is pulled to 0.8 and released has one "down" and no "up", so a page that drives between the two drives on. A trigger
# that is pulled fully counts as released at 0.95, while the finger still holds it. If it trembles there, it is
# released twice.
#
# Our page reads the trigger's value each time, and does not use events.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund gamepad-wrapper@1.3.4
cat > trigger.mjs <<'JS'
import { BUTTONS, GamepadWrapper } from 'gamepad-wrapper';

function pull(values) {
  const buttons = Array.from({ length: 17 }, () => ({ value: 0, touched: false, pressed: false }));
  const pad = new GamepadWrapper({ mapping: 'standard', axes: [0, 0, 0, 0], buttons });
  const found = { down: [], up: [] };
  for (const value of values) {
    for (const button of buttons) button.value = value;
    pad.update();
    if (pad.getButtonDown(BUTTONS.STANDARD.TRIGGER_RIGHT)) found.down.push(value);
    if (pad.getButtonUp(BUTTONS.STANDARD.TRIGGER_RIGHT)) found.up.push(value);
  }
  return found;
}
const found = JSON.stringify([pull([0, 0.4, 0.8, 0.3, 0, 0]), pull([0, 0.6, 1, 0.95, 1, 0.95, 0.5, 0])]);
console.log('to 0.8, fully:', found);
process.exit(found === '[{"down":[0.4],"up":[]},{"down":[0.6],"up":[0.95,0.95]}]' ? 0 : 1);
JS
node trigger.mjs
