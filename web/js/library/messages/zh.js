// The menu's name for the screen of models.
export default {
  'screen.home': '模型和记录',
};
