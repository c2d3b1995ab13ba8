"""The words one types in Python: plain arguments in, values of the field's libraries out."""
