// The sentences of the corrections.
export default {
  'settings.picture': 'Picture',
  'settings.turn': 'Turn the picture',
  'settings.mirrored': 'The picture is mirrored',
  'settings.turn_hint': 'If you change the picture, what the robot has learned so far no longer fits.',
  'settings.body': 'Body',
  'settings.body_hint': 'These corrections do not change what a direction means: left stays left.',
  'settings.trim': 'It pulls to one side: steer against it',
  'settings.swapped': 'Left and right are swapped',
  'settings.reverse': 'Motors that run backwards',
};
