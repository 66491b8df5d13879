// The places of a simulated robot.
export default {
  'settings.world': '地点',
  'settings.world_hint': '模拟机器人会被放到该地点的起点，学到的都保留。',
  'world.box': '空的围栏',
  'world.clutter': '杂物很多的房间',
  'world.corridor': '绕着书架的走廊',
  'world.follow': '有东西可跟随的大厅',
  'world.fork': '有岔路的大厅',
  'world.office': '办公室',
  'world.push': '有箱子可推的房间',
};
