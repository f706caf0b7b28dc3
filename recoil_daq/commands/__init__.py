"""The commands, by what they are about: each parses, calls one function, prints, and gives an exit code.

Their modules are without the postponed evaluation of annotations: typer would compile each of some hundred texts anew
at every start, which is a fifth of the time that ``--help`` takes.
"""
