"""What tunings of both levels count, compare and check: label and unit of each, told here alone.

Costs, their terms, outcomes and checks by name, for tables, figures and sentences; 1 is no unit.
What stands in braces is filled in where a check is made.
"""

from __future__ import annotations

from typing import NamedTuple


class Quantity(NamedTuple):
    """How a number of a tuning is called."""

    label: str
    unit: str

    @property
    def heading(self) -> str:
        """The label with the unit."""
        return f"{self.label} ({self.unit})"


_TABLE = """
costs, motion given
joint_load | 1 | load on the prosthetic leg and residual limb
metabolic | J/kg | joint-work estimate of energy
push_off | J/kg | push-off work, with a minus
tracking | BW² | deviation from the recorded ground reaction force
weighted | 1 | weighted sum of costs

terms, motion given
fore_aft | BW² | fore-aft force
lateral | BW² | lateral force
vertical | BW² | vertical force
joint_moments | 1 | prosthetic hip and knee moments squared
socket | 1 | socket force and moment squared
push_off_work | J/kg | minus the work on the shank in late stance
positive_work | J/kg | positive work of the prosthetic joints / 0.25
negative_work | J/kg | negative work of the prosthetic joints / 1.2
consistency | BW² | change of the ground reaction force

outcomes, motion given
stored_energy | J | energy stored in keel, foam and support
returned_energy | J | energy returned by toe-off
push_off_work | J/kg | push-off work on the shank
joint_work_energy | J/kg | joint-work estimate of metabolic energy
hip_moment | N m/kg | peak prosthetic hip flexion moment, either sign
knee_moment | N m/kg | peak prosthetic knee flexion moment, either sign
first_peak | BW | first peak of the vertical force
second_peak | BW | second peak of the vertical force
loading_rate | BW/s | loading rate of the vertical force
socket_force | BW | peak force on the residual limb
socket_moment | N m/kg | peak moment on the residual limb
force_change | BW | change of the ground reaction force from the recorded setting, RMS

outcomes, load given
stored_energy_same_load | J | energy stored under the recorded setting's load
returned_energy_same_load | J | energy returned under the recorded setting's load
push_off_work_same_load | J/kg | push-off work under the recorded setting's load

checks, motion given
brute_force_position | mm | distance from the sweep's minimum
brute_force_cost | size of the cost | difference from the sweep's minimum
solver | size of the cost | difference of the cost where {name_of} ends
gradient | 1 | largest error of the gradient against central differences
no_gradient | 1 | error of the gradient
step | mm | shift of the optimum between the two steps
smoothing | size of the cost | change of the cost without smoothing
smoothing_shift | mm | shift of the optimum without smoothing
convergence | 1 | steps of the walks that did not converge
force_change | BW | change of the ground reaction force from the recorded setting
recorded_force | BW | error of the ground reaction force at the recorded setting

terms, motion free
joint_load | 1 | joint and socket load
metabolic | 1 | metabolic estimate
activation | 1 | squared activations of the muscles
push_off | 1 | push-off work, negative
tracking | 1 | deviation from the consistent stride
normal | 1 | deviation from able-bodied walking
smooth | 1 | squared accelerations
steady | 1 | half of the joint and socket load, for steady torques

outcomes, motion free
push_off_work | J/kg | push-off work on the residual limb
push_off_power | W/kg | largest power of the prosthesis on its socket
com_push_off_work | J/kg | push-off work of the prosthetic leg on the centre of mass
stored_energy | J | energy that the prosthesis takes in over stance, negative work on its socket
returned_energy | J | energy that the prosthesis gives back, positive work on its socket
strain_energy | J | largest energy in keel and support
dorsiflexion | deg | largest turn of the keel's end, toe up
ankle_moment | N m/kg | largest moment at the pylon's end that turns the toe up
prosthetic_first_peak | BW | prosthetic first peak of the vertical force
prosthetic_second_peak | BW | prosthetic second peak of the vertical force
intact_first_peak | BW | intact first peak of the vertical force
intact_knee_moment | N m/kg | peak intact knee moment, either sign
prosthetic_hip_moment | N m/kg | peak prosthetic hip moment, either sign
prosthetic_knee_moment | N m/kg | peak prosthetic knee moment, either sign
knee_flexor_moment | N m/kg | largest prosthetic knee flexor moment late in stance
knee_extension | deg | least prosthetic knee flexion late in stance, negative, by markers on the
    socket
socket_moment | N m/kg | peak moment on the residual limb
metabolic | J/(kg m) | joint-work estimate of metabolic energy
joint_load | 1 | squared joint and socket load
activation | 1 | squared activations of the muscles
muscle_energy | J/(kg m) | metabolic energy of the muscles by their activation
stride_time | s | time of a stride
stride_length | m | length of a stride
motion_change | deg | root mean square change of the joint angles from the consistent stride
force_change | BW | root mean square change of the ground reaction from the consistent stride,
    worse foot

checks, motion free
tracking_motion | deg | tracked stride, worst angle
tracking_force | % body weight | tracked stride, resultant force of the worse foot
fixed_positions | 1 | against the best fixed position
starts | % | how much more searches from several positions end with
mesh | mm | twice as many intervals
carried_out | mm | fulcrum of the stride that the full model carries out
resimulation | % body weight | re-simulation, {kind}
found | mm | consistent stride, tracked from {mm:.0f} mm
smoothing | mm | contact smoothed over twice the depth
signs |  | signs as published of the variable-stiffness foot, at every step, that the
    foot alone lacks under an equal load; at the worst weight of able-bodied walking
"""


def _section(text: str) -> dict[str, Quantity]:
    """Of lines `name | unit | label` under a heading; what is indented goes on with a line."""
    rows = [line.split(" | ") for line in text.replace("\n    ", " ").splitlines()[1:]]
    return {name: Quantity(label, unit) for name, unit, label in rows}


(
    GIVEN_COSTS,
    GIVEN_TERMS,
    GIVEN_OUTCOMES,
    SAME_LOAD,
    GIVEN_CHECKS,
    FREE_TERMS,
    FREE_OUTCOMES,
    FREE_CHECKS,
) = map(_section, _TABLE.strip().split("\n\n"))
GIVEN_TERMS |= GIVEN_COSTS  # which are terms of a weighted one
