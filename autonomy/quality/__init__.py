"""Quality control of measured series: tests of QARTOD with exact times, and the rules they follow.

Source: U.S. IOOS, QARTOD manuals for real-time quality control. Flags are QARTOD's own; files of
OG1.0 write them as ``og1_flags`` says.
"""
