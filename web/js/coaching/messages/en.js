// The names of the screens about what the robot has learned.
export default {
  'screen.gallery': 'What have I learned?',
  'screen.why': 'Why?',
  'screen.teaching': 'Am I teaching well?',
  'screen.undo': 'Undo teaching',
};
