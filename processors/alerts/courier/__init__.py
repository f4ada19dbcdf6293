"""The courier: takes notifications out of the outbox on the broker and sends them, each once, or says that it failed.

    cnctwin/alerts/outbox/<id>    written by the alerts processor: a notification
    cnctwin/alerts/claim/<id>     written here before it is sent, and seen to stand on the broker
    cnctwin/alerts/delivery/<id>  written here afterwards: delivered, or failed with the reason
    cnctwin/alerts/receipt/<id>   written here: an emergency at Pushover that is to be asked about

`desk` decides, without I/O; `thread` reads and writes the broker; `service` and the files beside it speak to receivers.
"""
