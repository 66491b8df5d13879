// What the screen of models says.
export default {
  'home.models': '这台机器人会的',
  'home.none': '还没有保存任何东西。你教的会自动保存在这里。',
  'home.current': '使用中',
  'home.more': '关于 {name} 的更多内容',
  'home.name': '名称',
  'home.place': '地点',
  'home.keep': '保存',
  'home.load': '使用这个',
  'home.copy': '复制',
  'home.begin': '重新开始',
  'home.upload': '上传',
  'home.begun': '重新开始了：{name} 还什么都不会。',
  'home.deleted': '{name} 已删除。',
  'home.uploaded': '{name} 已上传。',
  'home.damaged': '此文件已损坏。',
  'home.lessons': '已学 {n} 个画面',
};
