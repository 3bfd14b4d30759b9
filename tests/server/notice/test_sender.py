"""Messages on their way to services that take, refuse, break, drip and hang."""

import asyncio
import sys
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio

from server.notice import sender as module
from server.notice.contact import Address, MailServer, apprise_url
from server.notice.sender import Message, Reply, Sender
from tests.server.notice.receiver import mail_service, web_service


@pytest_asyncio.fixture
async def sender() -> AsyncIterator[Sender]:
    """For whom no answer comes too late, however busy the machine is."""
    sender = Sender(patience_s=60.0)
    await sender.warm_up()
    yield sender
    await sender.stop()


def message_to(
    form: str, address: str, token: str = "", mail: MailServer | None = None, level: str = "warning"
) -> Message:
    place = Address.model_validate({"form": form, "address": address, "token": token})
    extras = {"notice": "notice-7", "alarm": "alarm-3"}
    url = apprise_url(place, mail, level, extras, "http://station.test/robot/mini-1")
    assert url is not None
    return Message(url, "mini-1: leak", "mini-1: Leak says yes.", level)


async def test_a_webhook_gets_the_message_and_its_reply_comes_back(sender: Sender):
    async with web_service() as service:
        reply = await sender.send(message_to("webhook", f"{service.url}?room=deck"))
        assert (reply.is_handed, reply.text) == (True, "HTTP 200 OK: thank you")
        (taken,) = service.taken
        assert taken.target == "/hook?room=deck"
        assert taken.headers["idempotency-key"] == "notice-7"
        assert taken.json["message"] == "mini-1: Leak says yes."
        assert (taken.json["title"], taken.json["alarm"]) == ("mini-1: leak", "alarm-3")
        assert taken.json["type"] == "warning"


async def test_ntfy_gets_priority_token_and_the_page_to_open(sender: Sender):
    async with web_service() as service:
        address = f"http://127.0.0.1:{service.port}/deck-watch"
        reply = await sender.send(message_to("ntfy", address, "tk_secret", level="critical"))
        assert reply.is_handed, reply.text
        (taken,) = service.taken
        assert taken.headers["authorization"] == "Bearer tk_secret"
        assert taken.json["topic"] == "deck-watch"
        assert taken.headers["x-priority"] == "max"
        assert taken.headers["x-click"] == "http://station.test/robot/mini-1"


async def test_a_mail_server_takes_a_mail_and_its_words_come_back(sender: Sender):
    async with mail_service() as service:
        server = MailServer(
            host="127.0.0.1", port=service.port, security="none", sender="station@example.org"
        )
        reply = await sender.send(message_to("mail", "ann@example.org", mail=server))
        assert (reply.is_handed, reply.text) == (True, "SMTP 250 2.0.0 kept as 4711")
        assert "Subject: mini-1: leak" in service.mails[0]


async def test_a_mail_server_that_refuses_says_why(sender: Sender):
    async with mail_service() as service:
        service.refuses = True
        server = MailServer(
            host="127.0.0.1", port=service.port, security="none", sender="station@example.org"
        )
        reply = await sender.send(message_to("mail", "ann@example.org", mail=server))
        assert not reply.is_handed
        assert "550 5.1.1 nobody of that name" in reply.text


@pytest.mark.parametrize(
    ("mode", "is_refusal", "words"),
    [
        ("refuse", True, "HTTP 403 Forbidden: thank you"),
        ("break", False, "HTTP 500 Trouble: thank you"),
        ("drip", False, "No whole answer within 1 s."),
        ("hang", False, "No whole answer within 1 s."),
    ],
)
async def test_each_trouble_of_a_service_has_its_sentence(
    sender: Sender, mode: str, is_refusal: bool, words: str
):
    is_endless = mode in ("drip", "hang")
    if is_endless:
        sender._patience_s = 1.0
    async with web_service(mode) as service:
        reply = await sender.send(message_to("webhook", service.url))
    assert (reply.is_handed, reply.is_refusal, reply.text) == (False, is_refusal, words)
    assert reply.is_doubtful == is_endless


async def test_a_closed_port_is_told_without_the_address(sender: Sender):
    async with web_service("closed") as service:
        url = f"http://ann:hidden@127.0.0.1:{service.port}/word-nobody-may-see"
        reply = await sender.send(message_to("webhook", url))
    assert reply == Reply(False, False, False, "The connection was refused.", reply.took_s)


async def test_services_that_hang_hold_up_no_other(sender: Sender):
    async with web_service("hang") as silent, web_service() as good:
        held = [
            asyncio.create_task(sender.send(message_to("webhook", silent.url))) for _ in range(8)
        ]
        await silent.until_called(8)
        reply = await sender.send(message_to("webhook", good.url))
        assert reply.is_handed
        assert not any(task.done() for task in held)
        await silent.close()
        assert not any(reply.is_handed for reply in await asyncio.gather(*held))


async def test_a_process_that_dies_is_started_anew(sender: Sender):
    async with web_service("hang") as service:
        held = asyncio.create_task(sender.send(message_to("webhook", service.url)))
        await service.until_called()
        process = sender._process
        assert process is not None
        process.process.kill()
        assert "started anew" in (await held).text
        service.mode = "take"
        assert (await sender.send(message_to("webhook", service.url))).is_handed


async def test_a_process_full_of_stuck_threads_is_replaced(
    sender: Sender, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(module, "STUCK_MAX", 1)
    async with web_service("hang") as service:
        first = sender._process
        sender._patience_s = 1.0
        assert not (await sender.send(message_to("webhook", service.url))).is_handed
        sender._patience_s = 60.0
        service.mode = "take"
        assert (await sender.send(message_to("webhook", service.url))).is_handed
        assert sender._process is not first


def test_only_a_hint_of_an_address_can_be_seen():
    secret = Address(form="webhook", address="https://hooks.example.org/T01/secret?key=hidden")
    assert secret.hint() == "webhook at hooks.example.org"
    assert Address(form="mail", address="ann@example.org").hint() == "a…@example.org"
    assert Address(form="apprise", address="tgram://123:hidden/42").hint() == "tgram://…"
    assert "not encrypted" in Address(form="ntfy", address="http://10.0.0.2/deck").hint()


@pytest.mark.parametrize(
    ("form", "address"),
    [
        ("mail", "ann"),
        ("mail", "ann@example.org,ben@example.org"),
        ("mail", "ann@example.org\nBcc:ben@example.org"),
        ("ntfy", "https://ntfy.example.org/"),
        ("ntfy", "https://ntfy.example.org/a/b"),
        ("webhook", "ftp://example.org/x"),
        ("webhook", "https://[::1"),
        ("apprise", "syslog://"),
        ("apprise", "syslog://localhost"),
        ("apprise", "dbus://x"),
        ("apprise", "nothing"),
    ],
)
def test_what_is_no_address_or_would_act_on_this_machine_is_refused(form: str, address: str):
    with pytest.raises(ValueError, match=r"address|machine"):
        Address.model_validate({"form": form, "address": address})


async def test_what_a_plugin_prints_is_no_answer():
    chatty = (
        "import server.notice.sender_process as one\n"
        "one.hand_over = lambda request: print('hello') or {'number': request['number']}\n"
        "one.main()\n"
    )
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", chatty,
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    assert process.stdin
    assert process.stdout
    process.stdin.write(b'{"number": 7}\n')
    await process.stdin.drain()
    said = [await process.stdout.readline() for _ in range(2)]
    process.stdin.close()
    await process.communicate()
    assert said == [b"\n", b'{"number": 7}\n']
