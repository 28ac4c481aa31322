"""Statures of the people of a country, as boxes show them: the scale of what walkers calibrate.

Statures are measured of people who stand, without shoes and with the hair pressed flat; boxes are drawn
around people who walk, with both, and a little wider than they are. The share of men among those who
pass a camera is unknown, and they are older than those who were measured.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Mean stature in cm of men and women aged 19 in 2019, by the country's code of ISO 3166-1: NCD Risk
# Factor Collaboration 2020, Lancet 396:1511 (65 million people of 5-19 years in 200 countries).
_TABLE = """
AD 178.8 165.5, AE 174.1 160.5, AF 168.5 156.1, AG 178.8 165.7, AL 174.1 162.2, AM 173.7 159.9,
AO 168.5 158.1, AR 174.8 161.2, AT 178.5 166.9, AU 178.8 164.7, AZ 174 161.4, BA 182.5 167.5,
BB 177 165.7, BD 165.1 152.4, BE 179.1 163.4, BF 171.9 161.3, BG 174.2 164.6, BH 172.8 158.3,
BI 167.3 155.1, BJ 168.4 158.4, BM 179.7 166.1, BN 166.3 154.9, BO 168.1 155.6, BR 175.7 162.4,
BS 174.4 163.5, BT 167 155.2, BW 173.2 162.1, BY 178.7 166.9, BZ 170.5 158.1, CA 178.7 164.7,
CD 168.6 156.3, CF 169 159.7, CH 178.7 164.3, CI 168.2 158.7, CK 178.3 167.3, CL 172.9 159.4,
CM 172.1 160.4, CN 175.7 163.5, CO 171.9 158, CR 174 160.4, CU 173.6 160.1, CV 176.3 163.1,
CY 172.7 160.6, CZ 181.2 168, DE 180.3 166.2, DJ 170.8 159.8, DK 181.9 169.5, DM 180.2 166.9,
DO 174.6 161.2, DZ 175 162.3, EC 167.3 155.2, EE 182.8 168.7, EG 174.6 160.9, ER 170.6 157.6,
ES 176.1 162, ET 168.8 157.2, FI 180.6 166.5, FJ 174 164.3, FM 169.6 159.7, FR 178.6 164.5,
GA 170.5 160, GB 178.2 163.9, GD 178.7 166, GE 176 163.2, GH 170.3 158.9, GL 173.8 161.4,
GM 168.4 161.7, GN 170.7 158.8, GQ 168.2 158, GR 179.3 165.8, GT 164.4 150.9, GW 168.2 158.7,
GY 172.2 159.6, HK 174.8 160.6, HN 169.6 155.2, HR 180.8 166.8, HT 172.2 160.6, HU 176.6 162.5,
ID 166.3 154.4, IE 179 164.5, IL 176 162.2, IN 166.5 155.2, IQ 173.8 158.7, IR 175.6 161.2,
IS 182.1 168.9, IT 174.4 161.8, JM 177 164.3, JO 174.8 159.5, JP 172.1 158.5, KE 170.5 159.4,
KG 171.7 160.2, KH 165.3 154.7, KI 170.1 161, KM 167.7 156.5, KN 173.7 162.8, KP 174.7 161.2,
KR 175.5 163.2, KW 175 160.1, KZ 175.5 161.7, LB 179 163.7, LC 176.4 165.5, LK 168.1 155.9,
LR 165.5 156.5, LS 167.9 156.7, LT 180.7 167.6, LU 178.5 165.1, LV 181.2 168.8, LY 176.4 162.6,
MA 176.4 161.2, MD 175.6 163, ME 183.3 170, MG 165.2 153.1, MH 165.3 154.8, MK 176.4 160.9,
ML 175 162, MM 166.7 154.7, MN 170.7 159.9, MR 165.5 160.1, MT 174.4 163, MU 173 158.9,
MV 167.9 154.3, MW 165.7 156.1, MX 170.3 157.9, MY 169.2 157.1, MZ 164.3 155.4, NA 169.7 160.3,
NE 170.3 159.8, NG 171.6 158.1, NI 169.9 155.6, NL 183.8 170.4, NO 180.5 166.4, NP 164.4 152.4,
NR 169.6 157.8, NU 177.2 167, NZ 177.7 164.7, OM 171.7 158.4, PA 170.2 158.2, PE 166.8 154.4,
PF 178.3 166.5, PG 163.1 156.9, PH 165.2 154.1, PK 167.3 154.8, PL 180.7 165.8, PR 179.5 163.1,
PS 175 161.3, PT 174.4 161.2, PW 170.6 159.5, PY 173.8 159.8, QA 173.3 160.7, RO 177.8 164.7,
RS 180.7 168.3, RU 176.6 164.5, RW 166 156.7, SA 170.7 158.8, SB 163.1 156.8, SC 175.9 162.5,
SD 172.1 160.4, SE 180.5 166.7, SG 173.5 161.3, SI 181 167.2, SK 181 167.1, SL 166.4 157.3,
SN 176.2 163.9, SO 171.2 159.9, SR 174.5 162.3, SV 170.7 156.4, SY 171.6 159.4, SZ 169.4 158.9,
TD 171.8 162.1, TG 170.1 159.1, TH 171.6 159.4, TJ 168.4 158.1, TK 176.1 166.1, TL 160.1 152.7,
TM 174.4 162.8, TN 176.9 161.7, TO 175.1 166.1, TR 176.4 162.4, TT 176 163.4, TV 171.3 163.6,
TW 171.4 159.9, TZ 167 156.9, UA 181 166.6, UG 168.7 158.5, US 176.9 163.3, UY 174.3 161.6,
UZ 170.9 160.3, VC 177.5 165.3, VE 173.5 160, VN 168.1 156.2, VU 168.3 160.5, WS 174.4 163.8,
YE 164.4 154.8, ZA 169.6 158.6, ZM 167.6 157.3, ZW 170.7 159.8
"""
MEAN_CM = {
    code: (float(men), float(women))
    for code, men, women in (row.split() for row in _TABLE.replace("\n", " ").split(","))
}

# Heels and soles of street shoes; hair above where a stadiometer presses it flat.
SHOES_M, SHOES_STD_M = 0.025, 0.01
HAIR_M, HAIR_STD_M = 0.015, 0.01
# Adults were born two or three decades before those of 19, when people were 0-3 cm shorter (NCD-RisC
# 2016, eLife 5:e13410), and the old have lost a centimetre or more.
AGE_M, AGE_STD_M = -0.01, 0.01
MEN_SHARE, MEN_SHARE_STD = 0.5, 0.2
# Within a sex and a country statures differ by 0.06 to 0.07 m.
SEX_STD_M = 0.066
# A walker's head is lower than when standing: by the bent knee and half the excursion of a stride
# (`pipeline.estimate.gait` has the sources).
WALKING_M = -0.033
# Boxes end a pixel or so above the crown and below the soles of a person who is about a hundred pixels
# tall, whoever or whatever draws them.
MARGIN_M, MARGIN_STD_M = 0.035, 0.02
# No country is stated: cameras are not spread as countries are. More than half of all are in China, and
# most of the others in North America and Europe; these three have equal parts in the centre. The spread
# is that of the countries of the table.
_EUROPE = "AT BE CH CZ DE DK ES FI FR GB GR HU IE IT NL NO PL PT RO SE"
_MOST_CAMERAS = ("CN", "US", _EUROPE)


class Statures(NamedTuple):
    """Adults as boxes show them: shod, with their hair, walking."""

    mean_m: float
    std_m: float  # from person to person
    mean_std_m: float  # of the mean of those who are here about `mean_m`


def adults_of(country: str) -> Statures:
    """Return the statures of the adults of a country, by its two letters in ISO 3166-1.

    Raises:
        KeyError: the table has no such country.
    """
    men_m, women_m = (cm / 100 for cm in MEAN_CM[country.upper()])
    return _as_seen(men_m, women_m, 0.0)


def adults_of_anywhere() -> Statures:
    """Return the statures of adults where no country is stated."""
    parts = [np.mean([MEAN_CM[c] for c in codes.split()], axis=0) for codes in _MOST_CAMERAS]
    men_m, women_m = np.mean(parts, axis=0) / 100
    between_m = np.std([np.mean(both) for both in MEAN_CM.values()]) / 100
    return _as_seen(float(men_m), float(women_m), float(between_m))


def _as_seen(men_m: float, women_m: float, between_m: float) -> Statures:
    apart_m = men_m - women_m
    middle_m = MEN_SHARE * men_m + (1 - MEN_SHARE) * women_m
    unknown_m = (SHOES_STD_M, HAIR_STD_M, AGE_STD_M, MARGIN_STD_M, MEN_SHARE_STD * apart_m)
    return Statures(
        mean_m=round(middle_m + SHOES_M + HAIR_M + AGE_M + WALKING_M + MARGIN_M, 3),
        # Of a mixture of two: within each, and between their means.
        std_m=round(float(np.hypot(SEX_STD_M, apart_m * (MEN_SHARE * (1 - MEN_SHARE)) ** 0.5)), 3),
        mean_std_m=round(float(np.linalg.norm([between_m, *unknown_m])), 3),
    )
