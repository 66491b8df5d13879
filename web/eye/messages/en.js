// The sentences on the page of the robot's eye.
export default {
  'eye.title': 'The robot’s eye',
  'eye.begin': 'Use this camera',
  'eye.insecure': 'A phone lets a page use its camera only over https: start the robot with --tls.',
  'eye.none': 'No camera was found on this device. Open this page on a device that has a camera.',
  'eye.in_use': 'Another program uses the camera. Close it, then try again.',
  'eye.refused': 'The browser refused the camera, or another program uses it. Allow it, then try again.',
  'eye.stands': 'The camera works. The robot is not moving.',
  'eye.drives': 'The camera works. The robot is driving!',
  'eye.another': 'Another phone is the eye now. Reload this page to take over.',
  'eye.viewer': 'This browser may only watch. Scan the code for the robot’s eye.',
  'eye.other_camera': 'The robot uses another camera. To use this one, start the robot with --camera phone.',
  'eye.rate': '{n} pictures per second',
};
