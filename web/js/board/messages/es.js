// The sentences on a robot's own page in a class.
export default {
  'stopped_by.teacher': 'Tu profesor o profesora ha parado el robot y lo liberará.',
};
