"""Names of channels, in the languages and abbreviations of bridges, mean what a seaman reads in them; and no more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.importing import Channel, Log, guess
from expdesign.importing.names import FOREIGN, marked

TIME_S = np.arange(400.0)
TURNING = 10.0 * np.sin(TIME_S / 20.0)
NAMES = {
    "rudder order": "Ruder soll [°]|Ruderlage Soll|Sollruder|Ruderwinkel Vorgabe|Ror ordre|Rorkommando|Ror beordret|"
    "Rorvinkel kommando|Ror settpunkt|Barre consigne|Angle de barre demandé|Consigne de barre|Roercommando|"
    "Roer opdracht|Roerhoek gewenst|Timón ordenado|Orden de timón|Angolo timone comandato|Comando timone|Roderorder|"
    "Beordrad rodervinkel|Roder börvärde|Peräsinkäsky|Peräsinkulma ohje|Rudder cmd",
    "rudder reached": "Ruder ist [°]|Ruderlage Ist|Istruder|Ror respons|Rorindikator|Angle de barre réel|Timón real|"
    "Roder ärvärde|Peräsinkulma mitattu|Rudder feedback",
    "rudder": "Ruderwinkel [Grad]|Ángulo de pala|Rorvinkel|Barre|Roerhoek|Timone|Peräsinkulma",
    "rudder p": "Ruderlage BB|Safran bâbord|Roer BB|Rorvinkel babord|Rudder Port [deg]|Timone sx",
    "rudder s": "Ruderlage StB|Roer stuurboord|Rudder Stbd|Timone dx",
    "heading_rad": "Kreisel|Kreiselkompass [°]|Kreiselkurs|Kurs (Kreisel)|Gyrokurs|Rechtweisender Kurs|rwK|Gyro kurs|"
    "Gyrokompass|Rettvisende kurs|Kompasskurs gyro|Cap gyro|Cap gyroscopique [°]|Gyrocompas|Cap vrai|Gyrokoers|"
    "Gyrokompas|Ware koers|Koers (gyro)|Girocompás|Rumbo giro|Rumbo verdadero|Girobussola|Prua girobussola|"
    "Sann kurs|Hyrräkompassi|Hyrräsuunta|Lacet|Guiñada|Gyro|Heading",
    "cog_rad": "KüG [°]|Kurs über Grund|Route fond|Koers over grond|Rumbo sobre fondo|Rumbo efectivo|Rotta sul fondo|"
    "Kurs over grunn|Kurs över grund|COG",
    "sog_mps": "FüG [kn]|Fahrt über Grund|Vitesse fond [nds]|Snelheid over grond|Velocidad sobre fondo|SOG [kn]",
    "r_radps": "Wendegeschwindigkeit [°/min]|Svingehastighet [°/min]|Dreiehastighet|Drejehastighed|Girvinkelhastighet|"
    "Giringshastighet|Bochtsnelheid|Draaisnelheid|Velocidad de caída|Velocidad de guiñada|Vitesse de lacet|"
    "Kääntymisnopeus|Velocità di accostata",
    "n": "Wellendrehzahl [1/min]|Akselturtall|Axelvarvtal|Asttoerental|Motortoeren|Tours hélice|Tours/min|"
    "Nombre de tours|Vitesse de rotation hélice|Giri elica|Revoluciones hélice|Potkurin kierrokset|"
    "Kierrosnopeus potkuri",
    "n p": "Drehzahl Bb [1/min]|Toerental schroef BB|RPM eje babor|Giri motore sinistra",
    "n s": "Propellerdrehzahl StB|Turtall styrbord aksel|Régime moteur tribord|Varvtal styrbord",
    # neither the ship's motion over ground, nor what drives her
    "": "Heading setpoint|Heading order|Course order|Ordered course|Sollkurs|Kurs soll|Cap consigne|Rumbo ordenado|"
    "Set heading|Heading cmd|Speed order|Ordered speed|ROT setpoint|Roll setpoint|Course to steer|Log speed|Speed log|"
    "Fahrt (Log)|Vitesse loch|Speed through water|Lateral speed|Bow speed|Fan speed|Turbocharger speed|Turbo rpm|"
    "Generator rpm|DG1 rpm|Rudder limit|Steering mode|Thrust [kN]|Speed max [kn]",
}  # fmt: skip
"""Column or kind of actuator signal, with its role or side -> names, of which some stand on loggers' screens."""


@pytest.mark.parametrize("meant", NAMES)
def test_a_name_means_what_a_seaman_reads_in_it(meant: str) -> None:
    column, _, more = meant.partition(" ")
    for name in NAMES[meant].split("|"):
        mark = marked(Channel(source="a.csv", name=name, time_s=TIME_S, values=TURNING))
        assert mark.column == column, name
        if mark.is_actuator:
            assert mark.role == ("" if len(more) < 2 else more), name
            assert mark.machine == ("", more if len(more) == 1 else "", ""), name


MACHINES = (
    "Rudder",
    "Azimuth",
    "Shaft speed",
    "Thruster 1",
    "Bow thruster",
    "Engine order",
    "Thrust",
    "Propeller speed",
)


@pytest.mark.parametrize("unit", FOREIGN)
def test_what_is_in_the_unit_of_another_quantity_is_no_order_or_position(unit: str) -> None:
    """A thrust in newtons was taken for the shaft speed that was reached, and used in its place."""
    for machine in MACHINES:
        assert marked(named(machine)).is_actuator, machine
        assert not marked(named(f"{machine} [{unit}]")).column, machine
        assert not marked(replace(named(machine), unit=unit)).column, machine
    if unit.isalpha():
        assert not marked(named(f"thrust1_{unit}")).column
        assert not marked(named(f"rudder torque {unit}")).column
        if len(unit) > 1:
            assert not marked(named(f"thruster_{unit}")).column


@pytest.mark.parametrize("name", ["tau_x_N", "tau_psi_Nm", "tau_x [kN]", "Fx_N", "Fx [N]", "X_N"])
def test_a_generalised_force_in_newtons_is_no_shaft_speed(name: str) -> None:
    assert not marked(named(name)).column


@pytest.mark.parametrize("name", ["SOG [kN]", "sog_kN", "Depth (pressure sensor) [m]", "Pressure depth [m]"])
def test_a_unit_of_the_reading_itself_says_what_it_is(name: str) -> None:
    """Knots are written kN, too, and a depth in metres is one whatever measures it."""
    assert marked(named(name)).column == ("depth_m" if "epth" in name else "sog_mps")


@pytest.mark.parametrize("unit", ["deg", "rad", "%", "rpm", "1/min", "PS", "Hz", "A", "N"])
def test_units_and_sides_of_orders_stay(unit: str) -> None:
    kind = {"deg": "Rudder", "rad": "Azimuth", "PS": "Rudder", "A": "Rudder"}.get(unit, "Engine order")
    assert marked(named(f"{kind} ({unit})")).is_actuator


def named(name: str) -> Channel:
    return Channel(source="a.csv", name=name, time_s=TIME_S, values=TURNING)


PORT_POSITIVE = (
    "Ruder soll [°] Bb+", "Rudder Cmd (P+)", "Rudder order, port positive", "Rudder (+ port) [deg]", "Rudder + = port",
    "rudder_port_positive_deg", "Rudder P+/S-", "Rudder [deg] +ve port", "Barre (bâbord positif)", "舵角(左舷+)",
    "Rudder (stbd -)", "Roer BB+", "Timone (sx +)", "Peräsin (positive to port)", "ROT [deg/min] port +",
    "Roll [deg] (port down +)", "Krängung Bb positiv [°]",
)  # fmt: skip
STARBOARD_POSITIVE = (
    "Ruder-Soll (StB positiv)",
    "Helm [deg, stbd +]",
    "Rudder (P-)",
    "Barre (tribord +)",
    "Heel stbd+ve",
)
SILENT = ("Rudder [deg]", "Rudder pos port", "Rudder port pos", "Rudder P - Feedback", "Rudder port-feedback")


@pytest.mark.parametrize("name", [*PORT_POSITIVE, *STARBOARD_POSITIVE, *SILENT])
def test_a_side_that_a_name_calls_positive_is_a_sign_and_no_second_machine(name: str) -> None:
    channel = Channel(source="a.csv", name=name, time_s=TIME_S, values=TURNING)
    (use,) = guess([Log(source="a.csv", clock="no clock", channels=(channel,))]).uses
    sign = -1.0 if name in PORT_POSITIVE else 1.0
    assert use.column
    assert np.sign(use.scale) == sign, use
    assert ("port is positive by its name" in use.why) == (sign < 0)
    assert name in SILENT or not any(marked(channel).machine)


def test_a_rate_counts_as_the_heading_shows_whatever_its_name_says() -> None:
    names = {"Heading": 100.0 + 200.0 * (1.0 - np.cos(TIME_S / 20.0)), "ROT [deg/s] (port +)": TURNING}
    channels = tuple(Channel(source="a.csv", name=name, time_s=TIME_S, values=own) for name, own in names.items())
    log = Log(source="a.csv", clock="no clock", channels=channels)
    (use,) = (use for use in guess([log]).uses if use.column == "r_radps")
    assert use.scale == 1.0


def test_an_order_that_is_left_out_is_called_one() -> None:
    channels = tuple(
        Channel(source="a.csv", name=name, time_s=TIME_S, values=TURNING) for name in ("Gyro", "Heading setpoint")
    )
    uses = guess([Log(source="a.csv", clock="no clock", channels=channels)]).uses
    assert [(use.column, use.why) for use in uses if not use.column] == [("", "an order by its name, no reading")]
    assert [use.channel for use in uses if use.column == "heading_rad"] == ["Gyro"]
