export default {
  'screen.gallery': '我学到了什么？',
  'screen.why': '为什么？',
  'screen.teaching': '我教得好吗？',
  'screen.undo': '撤销教学',
};
