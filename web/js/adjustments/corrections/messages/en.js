// The sentences of the corrections.
export default {
  'settings.picture': 'Picture',
  'settings.turn': 'Turn the picture',
  'settings.mirrored': 'The picture is mirrored',
  'settings.turn_hint': 'After a change, what the robot learned before no longer fits.',
  'settings.body': 'Body',
  'settings.body_hint': 'The directions keep their meaning.',
  'settings.trim': 'It pulls to one side: steer against it',
  'settings.swapped': 'Left and right are swapped',
  'settings.reverse': 'Motors that turn the other way',
};
