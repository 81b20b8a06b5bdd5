"""The paper's tables and figures, made again: printed numbers beside ours.

An application of the package, run by `make reproduce` or `python -m reproduction --only table5`. A
folder for each of the paper's tables (`table4` to `table7`), for its figures (`figures`, of 10 to
15, and `figure16`), for the `slips` of its equations and for the `cable_modes` that it leaves out:

    work.py       computes, in cases that depend on nothing but code, assumptions, printed numbers
    section.py    the cases, and the section of the report that is made of their results
    claims.py     what the paper says, beside what we get, and what could have come out otherwise
    tables.py     tables to read; the smaller folders have claims and tables in section.py
    texts.yaml    the sentences of all these, with places for the numbers

What they have in common is here: what a section is (`section`), texts, assumptions and printed
numbers, null models, the runs of the tests (`traces`, `believed`), which code a case depends on
(`sources`), running the cases (`reproduce`), the order of the `registry`, and the `report`.
"""
