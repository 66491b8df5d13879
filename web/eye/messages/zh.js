// The sentences on the page of the robot's eye.
export default {
  'eye.title': '机器人的眼睛',
  'eye.begin': '使用此摄像头',
  'eye.insecure': '手机只向 https 页面开放摄像头：请用 --tls 启动机器人。',
  'eye.none': '此设备上没有找到摄像头。请在有摄像头的设备上打开此页面。',
  'eye.in_use': '另一个程序正在使用摄像头。请关闭它，然后重试。',
  'eye.refused': '浏览器拒绝了摄像头，或其他程序正在使用它。请允许后重试。',
  'eye.stands': '摄像头正常。机器人没有动。',
  'eye.drives': '摄像头正常。机器人在行驶！',
  'eye.another': '现在由另一部手机当眼睛。重新加载本页可换回来。',
  'eye.viewer': '此浏览器只能观看。请扫描“机器人的眼睛”的二维码。',
  'eye.other_camera': '机器人用的是另一个摄像头。要用这个，请用 --camera phone 启动机器人。',
  'eye.rate': '每秒 {n} 帧',
};
