// The places of a simulated robot.
export default {
  'settings.world': 'Place',
  'settings.world_hint': 'The simulated robot is put at the start of this place and keeps everything it has learned.',
  'world.box': 'An empty box',
  'world.clutter': 'A cluttered room',
  'world.corridor': 'A corridor around shelves',
  'world.follow': 'A hall with something to follow',
  'world.fork': 'A hall with a fork',
  'world.office': 'An office',
  'world.push': 'A room with a box to push',
};
