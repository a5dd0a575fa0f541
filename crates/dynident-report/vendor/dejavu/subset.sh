#!/bin/sh
# subset.sh FONT.ttf: makes the font of this folder again, with fonttools 4.68.0.
exec pyftsubset "$1" --output-file="$(dirname "$0")/DejaVuSansCondensed.ttf" --no-hinting --layout-features=ccmp,mark,mkmk --drop-tables+=MATH,gasp \
    --unicodes=20-7E,A0-17F,300-304,306-30C,370-3FF,1E00-1EFF,2010-2015,2018-2022,2026,202F,2030-2033,2070-209C,20AC,2113,2190-2194,21D2,2200,2202-2209,220F,2211-2213,2217-221A,221D-221E,2220,2225-222B,223C,2248,2260-2265,226A-226B,2295,2297,22A5,22C5,25A0-25A1,25B2-25B3,25C6-25C7,25CB,25CF,2713,2717
