import assert from 'node:assert/strict';
import { test } from 'node:test';

import { declare, inColumns } from '../../web/js/moves.js';

const own = (name, steering) => ({ name, label: { en: name }, icon: '', does: '', steering, throttle: 0.5 });

test('left moves are on the left and right moves on the right, however many moves there are', () => {
  for (let lefts = 0; lefts < 4; lefts++) {
    for (let rights = 0; rights < 4; rights++) {
      const moves = [
        ...Array.from({ length: lefts }, (_, i) => own(`l${i}`, -0.3 * (i + 1))),
        ...Array.from({ length: 3 }, (_, i) => own(`s${i}`, 0)),
        ...Array.from({ length: rights }, (_, i) => own(`r${i}`, 0.3 * (i + 1))),
      ];
      declare(moves);
      const names = moves.map((move) => move.name);
      const { rows, areas } = inColumns(names);
      const taken = new Set();
      for (const name of names) {
        const [top, left, end, right] = areas.get(name).split(' / ').map(Number);
        assert.equal(left, { l: 1, s: 2, r: 3 }[name[0]]);
        assert.equal(right, left + 1);
        assert.ok(top >= 1 && end > top && end <= rows + 1);
        for (let row = top; row < end; row++) {
          assert.ok(!taken.has(`${row} ${left}`), 'no cell has two moves');
          taken.add(`${row} ${left}`);
        }
      }
    }
  }
});

test('the classic moves have sides; a move with unknown steering has none', () => {
  declare([own('coast', 0), { ...own('fire', null), throttle: null }]);
  const { rows, areas } = inColumns(['left', 'forward', 'coast', 'backward', 'right']);
  assert.equal(rows, 3);
  assert.equal(areas.get('left'), '1 / 1 / 4 / 2');
  assert.equal(areas.get('right'), '1 / 3 / 4 / 4');
  assert.equal(areas.get('backward'), '3 / 2 / 4 / 3');
  assert.equal(inColumns(['left', 'right', 'fire']), null);
});
