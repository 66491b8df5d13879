import assert from 'node:assert/strict';
import { test } from 'node:test';

import { mood } from '../../web/js/mood.js';

const robot = (more) => ({ lessons: 50, mode: 'train', driven_by: 'pilot', action: 'forward', asks_pilot: false, ...more });
const face = (more, readiness = null, link = 'open', lead = null) => mood({ robot: robot(more), link, readiness, lead });

test('the face shows what the robot is doing', () => {
  assert.equal(mood({ robot: null, link: 'connecting', readiness: null, lead: null }), 'listening');
  assert.equal(face({}), 'listening');
  assert.equal(face({ mode: 'autonomous', driven_by: 'robot' }), 'sure');
  assert.equal(face({ mode: 'autonomous', driven_by: 'robot', asks_pilot: true }, { stage: 'ready' }), 'unsure');
  assert.equal(face({ mode: 'stopped', driven_by: 'nobody' }, { stage: 'ready' }), 'proud');
});

test('the face claims nothing before the robot was taught, without a link, or in a study', () => {
  assert.equal(face({ lessons: 0 }, { stage: 'ready' }), 'listening');
  assert.equal(face({}, { stage: 'ready' }, 'lost'), 'listening');
  assert.equal(face({}, { stage: 'ready' }, 'open', { isOver: false }), 'listening');
});
