"""The tables of Markdown text as one CSV: python3 docs/tables.py [NAME..] < TEXT > docs/src/data/FILE.csv

NAMES are the columns' names, the nearest heading above a table and its first column's name in front where --heading is given; without names, those of
the first table. Programs of this project print their tables as Markdown; what is too long for a page of the book stands in docs/src/data.
"""
import csv
import sys

arguments = sys.argv[1:]
with_heading = "--heading" in arguments
names = [name for name in arguments if name != "--heading"]
heading, header, rows = "", None, []
for line in sys.stdin:
    line = line.strip()
    cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else None
    if line.startswith("#"):
        heading = line.lstrip("# ")
    if cells is None:
        header = None
    elif header is None:
        header = cells
    elif not all(set(cell) <= set("-: ") and cell for cell in cells):
        rows.append(([heading, header[0]] if with_heading else []) + cells)
        names = names or header
writer = csv.writer(sys.stdout, lineterminator="\n")
writer.writerow(names)
writer.writerows(rows)
