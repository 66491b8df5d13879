// The sentences of the corrections.
export default {
  'settings.picture': '画面',
  'settings.turn': '旋转画面',
  'settings.mirrored': '画面是镜像',
  'settings.turn_hint': '更改画面后，机器人以前学到的不再适用。',
  'settings.body': '车身',
  'settings.body_hint': '这些修正不改变方向的含义：左仍然是左。',
  'settings.trim': '偏向一侧：往另一侧修正',
  'settings.swapped': '左右接反了',
  'settings.reverse': '反转的电机',
};
