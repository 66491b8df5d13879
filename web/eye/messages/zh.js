// The sentences on the page of the robot's eye.
export default {
  'eye.title': '机器人的眼睛',
  'eye.begin': '使用此相机',
  'eye.insecure': '手机只向 https 页面提供相机：请用 --tls 启动机器人。',
  'eye.none': '此设备上没有找到相机。请在有相机的设备上打开此页面。',
  'eye.in_use': '另一个程序正在使用相机。请关闭它，然后重试。',
  'eye.refused': '相机被拒绝或正被占用。请允许后重试。',
  'eye.stands': '我看得见。机器人没有动。',
  'eye.drives': '我看得见。机器人在行驶！',
  'eye.another': '现在另一部手机是眼睛。重新加载本页可换回来。',
  'eye.viewer': '此浏览器只能观看。请扫描“机器人的眼睛”的二维码。',
  'eye.other_camera': '机器人使用另一台相机：请用 --camera phone 启动。',
  'eye.rate': '每秒 {n} 个画面',
};
