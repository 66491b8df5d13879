// The sentences on a robot's own page in a class.
export default {
  'stopped_by.teacher': '老师让机器人停下了，会由老师解除。',
};
