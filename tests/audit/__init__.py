"""The auditor: a second, naive reading of captures and reports, which decides whether what a report says is true.

It shares no code with rules, pairing, diagnosis or report of `ds47`: what it takes from the package is the report
itself, as `python -m ds47` prints it, and the catalogue's names of arguments. It is slow and simple on purpose.

    message         the bytes of a DS47 message, walked block by block
    wire            frames, RPC calls and records of a capture file
    dp              frames, exchanges and records of PROFIBUS
    reading         a report as JSON beside the frames it was made of
    memory          which parameter is meant, and what was written to it last
    claims          what findings DS1xx to DS4xx claim
    cyclic          the bytes of a channel in cyclic frames
    pkw             transactions in cyclic frames, and what findings DS5xx claim
    s7              what findings DS9xx claim; s7_wire reads their frames, s7_moment tries all orders
    causes          what diagnoses DS7xx claim
    expected        a golden list, recounted, and what findings DS602 claim
    corrected       whether a drive would take a corrected request
    words           whether a sentence says just its arguments
    page            the text report: headlines, counts, filters, sums, lines
    stations        the table of the stations of PROFIBUS, and what findings DS8xx claim
    html            the page: tiles, drives, problems, the rows of its data
    drive           a simulated drive that can be asked whether it would take a request
    conversations   random conversations, one for each plan
    lines           the same on PROFIBUS
    gaps            what a capture does not have; cuts makes such captures, holes reads them beside the whole one
    run             all of it over a capture
    seeds           many conversations; `python -m tests.audit` for them and for captures
"""
