# two moving bodies, several geoms, box on box, against; sliding with default friction; capsule vertical drop; mjSpec names
import mujoco, numpy as np
from vsf_drake.mujoco import calibrate
X="""<mujoco><option timestep="{h}" cone="elliptic" impratio="10"/><worldbody><geom name="floor" type="plane" size="5 5 1"/>
<body name="a" pos="0 0 .1"><freejoint/><geom name="low" type="box" size=".2 .2 .1" mass="20"/></body>
<body name="b" pos="0 0 .3"><freejoint/><geom name="high" type="box" size=".1 .1 .1" mass="5"/></body></worldbody></mujoco>"""
for h in (5e-4,2e-3,5e-3):
    m=mujoco.MjModel.from_xml_string(X.format(h=h))
    calibrate(m,geoms=["high"],stiffness=1e4,damping=100,against="low")
    calibrate(m,geoms=["low"],stiffness=5e4,damping=500)
    d=mujoco.MjData(m); mujoco.mj_step(m,d,nstep=round(6/h))
    z=d.qpos.reshape(-1,7)[:,2]
    print(h,'priority',m.geom_priority,'low depth ratio',(.1-z[0])*5e4*4/(25*9.81),'high',(.3-z[1]+z[0]-.1-0)*0+((z[0]+.1)-(z[1]-.1))*1e4*4/(5*9.81))
m=mujoco.MjModel.from_xml_string(X.format(h=2e-3))
calibrate(m,geoms=["low"],stiffness=5e4,damping=500); calibrate(m,geoms=["high"],stiffness=1e4,damping=100,against="low")
d=mujoco.MjData(m); mujoco.mj_step(m,d,nstep=3000); z=d.qpos.reshape(-1,7)[:,2]
print('other order',m.geom_priority,(.1-z[0])*5e4*4/(25*9.81),((z[0]+.1)-(z[1]-.1))*1e4*4/(5*9.81))
