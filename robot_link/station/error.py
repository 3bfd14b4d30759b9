"""What can go wrong in an exchange with a robot, by what the caller can do.

ServiceError
├── OutOfContactError        nothing was asked; try again at the next contact
├── NoAnswerError            try again at the next contact
└── ServiceRefusedError      the robot said no; the sentence says why
"""


class ServiceError(Exception):
    """An exchange did not come to its end; the message is a sentence for the operator."""


class OutOfContactError(ServiceError):
    """The robot cannot be asked now, so nothing was sent."""


class NoAnswerError(ServiceError):
    """The robot stayed silent."""


class ServiceRefusedError(ServiceError):
    """The robot refused, or what it holds is not what was asked for."""
