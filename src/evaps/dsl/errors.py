"""What all errors of the user's making have in common."""


class UserError(ValueError):
    """The user's input is wrong; the message says in one line what it is and how to mend it."""
