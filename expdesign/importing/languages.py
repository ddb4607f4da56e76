"""What the names of channels mean in English words, whatever language of ships they are written in; and their sense."""

from __future__ import annotations

import re
import unicodedata

LATIN = {
    "latitude": "breite|breitengrad|leveysaste|latitud|latitudine|breddegrad|bredde|bredd|breedtegraad|breedte",
    "longitude": "lange|laenge|langengrad|pituusaste|longitud|longitudine|lengdegrad|laengdegrad|lengde|"
    "langd|lengtegraad|lengte",
    "speed over ground": "(fahrt|geschwindigkeit) uber grund|fu ?g|vitesse (sur (le )?)?fond|nopeus pohjan suhteen|"
    "fart over grunn|fart over grund|(snelheid|vaart) over (de )?grond|grondsnelheid|velocidad (sobre (el )?)?fondo|"
    "velocita (sul )?fondo",
    "water speed": "(fahrt|geschwindigkeit) durchs wasser|fd ?w|(fahrt|vitesse|fart|vaart|snelheid) (log\\w*|loch)|"
    "loch|logge|vitesse surface|nopeus veden suhteen|"
    "fart (genom vattnet|gjennom vann(et)?|gennem vandet)|snelheid door het water|velocidad (en el )?agua",
    "course over ground": "kurs uber grund|ku ?g|(route|cap) (sur (le )?)?fond|kurssi pohjan suhteen|"
    "kurs over grunn|kurs over grund|"
    "grondkoers|koers over (de )?grond|rumbo ((sobre (el )?)?fondo|efectivo)|rotta (sul )?fondo",
    "gyro heading": "(kurs|kompass?kurs|kompass?koers|koers|cap|rumbo|prua) (gyro|kreisel|giro)|"
    "(kurs|koers|cap|rumbo|prua) (kreisel|gyro|giro)(kompass?|compass?|bussola|scopi\\w+)|"
    "(kreisel|gyro|giro|hyrra) ?(kompass?|compass?|kompassi|bussola)?(kurs|koers|suunta)|"
    "(kreisel|gyro|giro|hyrra) ?(kompass?|compass?|kompassi|bussola)|kreisel|hyrra|giroscopic[oa]",
    "true heading": "rechtweisende[rn]? kurs|rw ?k|(retvisende|rettvisende|rattvisande|sann|sant|ware) (kurs|koers)",
    "magnetic heading": "(magnet)?kompasskurs|missweisender kurs|mw ?k|mg ?k|"
    "cap (magnetique|compas)|magneettinen suunta|"
    "rumbo magnetico|prua (magnetica|bussola)|kompaskoers",
    "heading": "steuerkurs|vorausrichtung|cap vrai|^cap$|keulasuunta|suunta|(stavad|styrd|styrt|styret) kurs|"
    "koers voorliggend|voorliggende koers|stuurkoers|rumbo verdadero|rumbo|prua vera|prua",
    "rate of turn": "wendegeschwindigkeit|wenderate|drehrate|drehgeschwindigkeit|gierrate|taux de giration|"
    "vitesse (angulaire )?de (giration|lacet)|kaantymisnopeus|gir(ings|vinkel)?hastighe[td]|girrate|"
    "(sving|svinge|dreie|dreje)hastighe[td]|draaisnelheid|bochtsnelheid|"
    "bochtaanwijzer|velocidad de (giro|caida|guinada)|velocidad angular|velocita (angolare )?di (accostata|imbardata)",
    "yaw": "lacet|guinada|imbardata",
    "rpm": "drehzahl|umdrehungen|regime|kierrosluku|kierrosnopeus|kierrokset|varvtal|turtall|omdre[ij]ninger|"
    "toerental|toeren|revoluciones|giri|(nombre de )?tours( (par )?min(ute)?)?|vitesse de rotation",
    "rudder": "ruderlage|ruderwinkel|ruder|angle de barre|barre|safran|gouvernail|perasinkulma|perasin|rodervinkel|"
    "rorvinkel|roder|ror|roerhoek|roerstand|roer|angulo de (timon|pala)|(pala del )?timon|angolo (di |del )?timone|"
    "timone",
    "order": "soll|sollwert|vorgabe|consigne|demandee?|ohje|kasky|asetusarvo|borvarde|ordret?|beordr\\w+|bestilt|"
    "settpunkt|kommando|commando|opdracht|gewenste?|orden|ordenad[oa]|comando|comandat[oa]|richiest[oa]",
    "actual": "istwert|ist|indikator|malt|mesuree?|reel(le)?|(?<=rudder )real|mitattu|"
    "toteutunut|arvarde|gemeten|medido|reale|misurato",
    "time": "uhrzeit|zeit|zeitstempel|heure|horodatage|aika|aikaleima|tid|tidpunkt|tidspunkt|tijd|tijdstip|hora|ora",
    "date": "datum|paivays|paivamaara|pvm|dato|fecha",
    "roll": "krangung|rollwinkel|gite|roulis|kallistus|keinunta|krangning|rullning|rulling|helling|escora|"
    "rollio|sbandamento",
    "depth": "wassertiefe|tiefe|profondeur|syvyys|djup|dybde|diepte|waterdiepte|profundidad|profondita",
    "wind speed": "windgeschwindigkeit|vitesse (du )?vent|tuulen nopeus|vindhastighet|windsnelheid|"
    "velocidad del viento|"
    "velocita del vento",
    "wind direction": "windrichtung|direction (du )?vent|tuulen suunta|vindretning|vindriktning|windrichting|"
    "direccion del viento|direzione del vento",
    "bow thruster": "bugstrahlruder|propulseur d etrave|keulapotkuri|bogpropeller|baugpropell|boegschroef|"
    "helice de proa|elica di prua",
    "port": "backbord|babord|paapuuri|vasen|bakboord|babor|sinistra|sx",
    "starboard": "steuerbord|st b|tribord|tb|tyyrpuuri|oikea|styrbord|stuurboord|estribor|dritta|dx",
    "variation": "missweisung|declinaison|eranto|missvisning|misvisning|variatie|declinacion|declinazione",
    "position": "posizione|posicion|sijainti|positie",
}  # fmt: skip
"""English words -> patterns of words in German, French, Finnish, Swedish, Norwegian, Danish, Dutch, Spanish, Italian,
without accents."""
PATTERNS = tuple((english, re.compile(rf"\b(?:{foreign})\b")) for english, foreign in LATIN.items())
RUDDERS = "ruderlage|ruderwinkel|ruder|ror|roder|roer|perasin"
TURNS = "drehzahl|turtall|varvtal|toerental|toeren|omdre[ij]ninger|kierrosluku|kierrokset"
COMPOUNDS = (
    (re.compile(rf"\b(soll|ist)((?:{RUDDERS}|{TURNS}|kurs|fahrt)\w*)"), r"\1 \2"),
    (
        re.compile(rf"\b((?:{RUDDERS}|\w*drehzahl)\w*?)(soll|ist|indikator|[kc]ommando|ordre|order|kasky|ohje)\b"),
        r"\1 \2",
    ),
    (re.compile(rf"(?<=[a-z])((?:{TURNS})\b)"), r" \1"),
)
"""Words of two that are taken apart: an order or what was reached, and of what; a machine and its revolutions."""
EASTERN = {
    "緯度": "latitude", "経度": "longitude", "纬度": "latitude", "经度": "longitude", "위도": "latitude",
    "경도": "longitude",
    "対地速力": "speed over ground", "対地船速": "speed over ground", "対地速度": "speed over ground",
    "对地航速": "speed over ground", "对地速度": "speed over ground", "航速": "speed over ground",
    "대지속력": "speed over ground", "대지속도": "speed over ground",
    "対水速力": "water speed", "対水速度": "water speed", "对水航速": "water speed", "대수속력": "water speed",
    "対地針路": "course over ground", "对地航向": "course over ground", "대지침로": "course over ground",
    "船首方位角": "heading", "船首方位": "heading", "方位角": "heading", "艏向角": "heading", "艏向": "heading",
    "船首向": "heading", "航向角": "heading", "航向": "heading", "선수방위각": "heading", "선수방위": "heading",
    "선수각": "heading",
    "回頭角速度": "rate of turn", "旋回角速度": "rate of turn", "回頭率": "rate of turn", "转首角速度": "rate of turn",
    "艏摇角速度": "rate of turn", "转向率": "rate of turn", "선회각속도": "rate of turn", "회두각속도": "rate of turn",
    "プロペラ回転数": "propeller rpm", "主機回転数": "engine rpm", "回転数": "rpm", "螺旋桨转速": "propeller rpm",
    "主机转速": "engine rpm", "转速": "rpm", "프로펠러 회전수": "propeller rpm", "회전수": "rpm",
    "命令舵角": "rudder order", "指令舵角": "rudder order", "舵角指令": "rudder order", "명령타각": "rudder order",
    "実舵角": "rudder actual", "实际舵角": "rudder actual", "실타각": "rudder actual", "舵角": "rudder",
    "타각": "rudder",
    "日時": "date time", "時刻": "time", "時間": "time", "时间": "time", "日期": "date", "日付": "date", "시간": "time",
    "일시": "date time", "날짜": "date", "水深": "depth", "수심": "depth", "横揺角": "roll", "横摇角": "roll",
    "横倾角": "roll",
    "횡동요각": "roll", "風速": "wind speed", "风速": "wind speed", "풍속": "wind speed", "風向": "wind direction",
    "风向": "wind direction", "풍향": "wind direction", "左舷": "port", "右舷": "starboard", "좌현": "port",
    "우현": "starboard",
}  # fmt: skip
"""Terms of Japanese, Chinese and Korean -> English words."""
LONGEST_FIRST = sorted(EASTERN, key=len, reverse=True)


def is_foreign(text: str) -> bool:
    """Whether a term of Japanese, Chinese or Korean that is known stands in a text."""
    return sum(text.count(term) for term in EASTERN) > 1


def without_eastern(name: str) -> str:
    """A name with its terms of Japanese, Chinese and Korean in English."""
    if name.isascii():
        return name
    for term in LONGEST_FIRST:
        name = name.replace(term, f" {EASTERN[term]} ")
    return name


def in_english(words: str) -> str:
    """A name in lower case words, with those of other languages of Latin letters in English."""
    for pattern, apart in COMPOUNDS:
        words = pattern.sub(apart, words)
    for english, pattern in PATTERNS:
        words = pattern.sub(english, words)
    return words


LETTERS = str.maketrans({"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "ß": "ss", "œ": "oe"})


def words(name: str) -> str:
    """A name in lower case words of English: `RPM_P` -> "rpm p", `ATT.DesYaw` -> "att des yaw"."""
    name = without_eastern(name).translate(LETTERS)
    name = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return in_english(" ".join(re.findall(r"[a-z]+|\d+", apart.lower().replace("²", "2"))))


SIDES = {
    -1.0: "port|ps|p|bb|left|backbord|b[aå]bord|bâbord|bakboord|babor|sinistra|sx|左舷|左|좌현",
    1.0: "starboard|stbd|stb|sb|s|right|steuerbord|tribord|tb|styrbord|stuurboord|estribor|dritta|dx|右舷|右|우현",
}
PLUS, MINUS = r"(?:\+(?:ve)?|positi[efv][^\W_]*)", r"(?:[-\u2212](?:ve)?|negati[efv][^\W_]*)"
TO = r"(?:(?:to|is|ist|nach|zu|til|till|naar|vers|a|à)\s+)?"
END = r"(?=$|[\s)\]},;/_])"
SENSES = tuple(
    (sign, re.compile(rf"(?<![^\W_])(?:{pattern}){END}", re.IGNORECASE))
    for side, names in SIDES.items()
    for sign, pattern in (
        (side, rf"(?:{names})(?:\s+down)?[\s=_]*{PLUS}|{PLUS}[\s=_]*{TO}(?:{names})"),
        (-side, rf"(?:{names})\s?=?(?:{MINUS})(?=\s*(?:$|[)\]}},;/]))|(?:{names})[\s_]+negati\w+"),
    )
)
"""Sign of the side that counts as positive, and the pattern of words that say so: `Bb+`, `(P-)`, `positive to port`."""
LEFT_OVER = (
    (re.compile(r"(?<=[(\[{])[\s,;:/]+|[\s,;:/_-]+(?=[)\]}]|$)"), ""), (re.compile(r"\(\s*\)|\[\s*\]|\{\s*\}"), ""),
    (re.compile("__+"), "_"),
)  # fmt: skip


def split_sense(name: str) -> tuple[str, float]:
    """A name without what it says of its sense, and that: -1 where port is positive, 1 for starboard, 0 for neither."""
    found = [(match.start(), sign) for sign, one in SENSES for match in one.finditer(name)]
    if not found:
        return name, 0.0
    for _, one in SENSES:
        name = one.sub("", name)
    for pattern, instead in LEFT_OVER:
        name = pattern.sub(instead, name)
    return name.strip(), min(found)[1]
