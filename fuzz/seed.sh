#!/usr/bin/env bash
# Makes fuzz/corpus/TARGET from the shipped files.
set -euo pipefail
cd "$(dirname "$0")"
mkdir -p corpus/{design,csv,units,feed,plan}

# Designs, and the examples of the blocks' own tests.
for file in ../configs/*.toml ../configs/*/*.toml ../configs/parts/*/*.toml ../examples/*.toml ../examples/*/*.toml targets/*.toml; do
    cp "$file" "corpus/design/$(tr / _ <<<"${file#../}")"
done

# Every text in quotation marks in a design is a quantity, or looks like one.
grep -oh '"[^"]*"' ../configs/*.toml ../configs/*/*.toml ../configs/parts/*/*.toml | tr -d '"' | sort -u | head -n 2000 |
    while read -r text; do printf %s "$text" >"corpus/units/$(printf %s "$text" | sha1sum | cut -c1-16)"; done

# A byte that chooses the declaration, then its file.
printf '\0t,lat,lon,h,s\n0,47.0,8.0,400,1\n1.5,47.00001,8,400.5,2\n3601,47,8,400,1\n3,47,8,400,1\n' >corpus/csv/place
printf '\0011520530308181.5,0.1,-0.2,3e-4,4\n1520530308191.4,0.1,0.2,3e-4,4\n1520530308201,x,0,0,4\n1520530308211,1,2,3,0\n' >corpus/csv/rates
printf '\002# a comment\nt;w;x;y;z;v\n1520530308181901469;1;0;0;0;4\n1520530309181901469;0.707;0.707;0;0;9\n"1520530310181901469";0.5;0.5;0.5;0.5;1\n' >corpus/csv/attitude
printf '\0030,1,2,3,350\n1,1.5,2,3,10\n3600,1,2,3,4\n' >corpus/csv/local
head -c 100 corpus/csv/place | tail -c +2 | gzip -n | { printf '\0'; cat; } >corpus/csv/packed

# An inertial unit at rest with a fix every second; then with a gap, a wrong stamp, a spike.
second() { head -c 100 /dev/zero; printf '\011\012'; }
{ second; second; second; } >corpus/feed/rest
{ second; printf '\004\210\023'; second; } >corpus/feed/gap
{ second; printf '\014\0\0\0\0\0\040\254\100'; second; } >corpus/feed/stamp
{ second; printf '\040\0\0\0\0\0\0\0\131\100'; second; } >corpus/feed/spike

# Patterns of two and of fifteen rows.
printf '\002\001\000\002\001\001\002' >corpus/plan/two
printf '\017\001\000\006\001\000\006\001\000\006\002\000\011\014\017' >corpus/plan/inertial
