"""The table of contact laws: the name of each and its file beside this one. Its place here is its
number in compiled code."""

CONTACT_LAWS = {
    "kelvin_voigt": "kelvin_voigt",
    "smooth": "smooth_contact",
    "hunt_crossley": "hunt_crossley",
}
FITTED_LAW = "kelvin_voigt"
"""The paper's, which a model and a contact file have that name none."""
