// The sentences on a robot's own page in a class.
export default {
  'stopped_by.teacher': 'Your teacher has stopped the robot and will release it.',
};
