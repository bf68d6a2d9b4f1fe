# The types with which Cython compiles scan.py. Plain Python never reads this file.
cimport cython

cdef const unsigned char* _UUIDS
cdef unsigned int _BIG_1, _BIG_2, _LITTLE_1, _LITTLE_2, _TAIL_1, _TAIL_2
cdef unsigned int _MAPPER_BIG_1, _MAPPER_BIG_2, _MAPPER_LITTLE_1, _MAPPER_LITTLE_2, _MAPPER_TAIL_1, _MAPPER_TAIL_2
cdef unsigned int _IPV4, _PROFINET, _LLDP, _TCP, _UDP, _PNIO_PORT, _ENHANCED
cdef long _ETHERNET, _RAW, _RAW_IPV4, _SLL, _SLL2, _PROFIBUS_DL, _USER0
cdef Py_ssize_t _MAX_FRAME, _BATCH, _ENTRY, _FIRST_AHEAD, _AHEAD, _KEPT, _FAR, _ROW, _NOWHERE, _SAMPLE, _RAREST, _OFTEN, _NEXT
cdef unsigned int _CONNECT, _REQUEST, _RESPONSE

cdef unsigned int _u16(const unsigned char* data, Py_ssize_t at) noexcept nogil

cdef unsigned int _u32(const unsigned char* data, Py_ssize_t at, bint big) noexcept nogil

cdef bint _is_tag(unsigned int kind) noexcept nogil

@cython.locals(at=Py_ssize_t, kind="unsigned int")
cdef bint _is_rt(const unsigned char* data, Py_ssize_t start, Py_ssize_t captured) noexcept nogil

@cython.locals(first="unsigned int", second="unsigned int", have=Py_ssize_t, uuid=Py_ssize_t, at=Py_ssize_t,
               one_to_four=bint)
cdef bint _is_pnio(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t end, bint cut, bint on_port
) noexcept nogil

@cython.locals(first="unsigned int", second="unsigned int")
cdef bint _is_mapper(const unsigned char* data, Py_ssize_t start) noexcept nogil

@cython.locals(at=Py_ssize_t)
cdef Py_ssize_t _network(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type
) noexcept nogil

cdef unsigned int _kind(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t at, long link_type
) noexcept nogil

@cython.locals(at=Py_ssize_t, udp=Py_ssize_t, kind="unsigned int", on_port=bint)
cdef bint _relevant(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type, Py_ssize_t original,
    const unsigned char* ports
) noexcept nogil

@cython.locals(tcp=Py_ssize_t, source="unsigned int", destination="unsigned int", port="unsigned int",
               number=Py_ssize_t)
cdef bint _is_tcp(
    const unsigned char* data, Py_ssize_t at, Py_ssize_t end, const unsigned char* ports
) noexcept nogil

ctypedef unsigned long long number_t

cdef extern from *:
    """
    #ifdef _WIN32
    #include <io.h>
    #define ds47_read(descriptor, data, most) _read((descriptor), (data), (unsigned)(most))
    #else
    #include <unistd.h>
    #define ds47_read(descriptor, data, most) read((descriptor), (data), (size_t)(most))
    #endif
    """
    Py_ssize_t ds47_read(int descriptor, void* data, Py_ssize_t most) nogil

cdef inline Py_ssize_t _read(int descriptor, unsigned char* data, Py_ssize_t at, Py_ssize_t most) noexcept nogil:
    return ds47_read(descriptor, data + at, most)

@cython.locals(byte=Py_ssize_t)
cdef void _put(unsigned char* entries, Py_ssize_t at, number_t value) noexcept nogil

@cython.locals(byte=Py_ssize_t, value=number_t)
cdef number_t _get(const unsigned char* entries, Py_ssize_t at) noexcept nogil

@cython.locals(at=Py_ssize_t)
cdef Py_ssize_t _note(
    unsigned char* entries, Py_ssize_t count, number_t number, number_t interface, number_t high, number_t low,
    number_t original, number_t captured, number_t start
) noexcept nogil

@cython.locals(found=list, numbers="const unsigned char*", view="const unsigned char*", at=Py_ssize_t,
               end=Py_ssize_t, start=Py_ssize_t, after=Py_ssize_t, frame=bytes)
cdef list _found(entries, Py_ssize_t count, data)

@cython.locals(entry=Py_ssize_t, at=Py_ssize_t, start=Py_ssize_t, captured=Py_ssize_t, byte=Py_ssize_t)
cdef Py_ssize_t _keep(
    const unsigned char* data, unsigned char* kept, Py_ssize_t used, unsigned char* entries, Py_ssize_t first,
    Py_ssize_t count
) noexcept nogil

@cython.locals(byte=Py_ssize_t)
cdef Py_ssize_t _to_front(unsigned char* data, Py_ssize_t start, Py_ssize_t end) noexcept nogil

@cython.locals(sample=Py_ssize_t)
cdef Py_ssize_t _sampled(Py_ssize_t number, Py_ssize_t senders) noexcept nogil

@cython.locals(at=Py_ssize_t)
cdef Py_ssize_t _rt(const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type) noexcept nogil

@cython.locals(at=Py_ssize_t, source=Py_ssize_t, row=Py_ssize_t, size=Py_ssize_t, byte=Py_ssize_t, period=Py_ssize_t)
cdef bint _is_due(
    unsigned char* rows, const unsigned char* data, Py_ssize_t start, Py_ssize_t end, Py_ssize_t number,
    Py_ssize_t senders, long link_type
) noexcept nogil

@cython.locals(news=bint, changed=bint, part=Py_ssize_t, parts=Py_ssize_t, kept=Py_ssize_t, first=Py_ssize_t, byte=Py_ssize_t,
               answered=Py_ssize_t)
cdef bint _is_news(
    unsigned char* rows, Py_ssize_t row, const unsigned char* data, Py_ssize_t at, Py_ssize_t end,
    Py_ssize_t period
) noexcept nogil

cdef class Scan:
    cdef public Py_ssize_t position, frames, end, passed
    cdef public bint stopped, more, paused
    cdef public Py_ssize_t interface
    cdef public unsigned int high, low
    cdef public list links
    cdef Py_ssize_t _known, _most, _senders
    cdef object _entries, _kept, _rows, _watches, _watched, _ids, _runs, _swapped, _ports
    cdef bint _big
    cdef Py_ssize_t _pieces

    cdef bytes _links(self)

    @cython.locals(count=Py_ssize_t)
    cdef list _compiled(self, data, Py_ssize_t end)

    @cython.locals(cyclic=bint, senders=Py_ssize_t)
    cdef bint _wants(
        self, const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type, Py_ssize_t original,
        Py_ssize_t number, unsigned char* rows, const unsigned char* ports
    ) noexcept nogil

    @cython.locals(at=Py_ssize_t, rpc=Py_ssize_t, number=Py_ssize_t, fragment=Py_ssize_t)
    cdef bint _sets_up(
        self, const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type
    ) noexcept nogil

    cdef Py_ssize_t _walk(
        self, const unsigned char* data, Py_ssize_t end, const unsigned char* links,
        unsigned char* entries, Py_ssize_t count, Py_ssize_t most, unsigned char* rows,
        const unsigned char* ports
    ) noexcept nogil

    @cython.locals(used=Py_ssize_t, passed=Py_ssize_t, more=bint, before=Py_ssize_t, advanced=Py_ssize_t,
                   got=Py_ssize_t)
    cdef Py_ssize_t _ahead(
        self, int descriptor, unsigned char* data, Py_ssize_t end, Py_ssize_t size, const unsigned char* links,
        unsigned char* entries, unsigned char* kept, Py_ssize_t room, unsigned char* rows,
        const unsigned char* ports
    ) noexcept nogil

cdef inline Py_ssize_t _unlocked(
    Scan scan, int descriptor, unsigned char* data, Py_ssize_t end, Py_ssize_t size, const unsigned char* links,
    unsigned char* entries, unsigned char* kept, Py_ssize_t room, unsigned char* rows, const unsigned char* ports
):
    with nogil:
        return scan._ahead(descriptor, data, end, size, links, entries, kept, room, rows, ports)

cdef class PcapScan(Scan):
    cdef Py_ssize_t _header
    cdef object _layout, _record

    @cython.locals(big=bint, header=Py_ssize_t, link_type=long, position=Py_ssize_t, number=Py_ssize_t,
                   last=Py_ssize_t, start=Py_ssize_t, captured=Py_ssize_t, original=Py_ssize_t,
                   seconds="unsigned int", fraction="unsigned int", newest=Py_ssize_t, after=Py_ssize_t)
    cdef Py_ssize_t _walk(
        self, const unsigned char* data, Py_ssize_t end, const unsigned char* links,
        unsigned char* entries, Py_ssize_t count, Py_ssize_t most, unsigned char* rows,
        const unsigned char* ports
    ) noexcept nogil

cdef class PcapngScan(Scan):
    cdef object _block, _layout, _word

    @cython.locals(big=bint, position=Py_ssize_t, number=Py_ssize_t, last=Py_ssize_t, total=Py_ssize_t,
                   interface=Py_ssize_t, captured=Py_ssize_t, original=Py_ssize_t, start=Py_ssize_t,
                   link_type=long, high="unsigned int", low="unsigned int", newest=Py_ssize_t,
                   after=Py_ssize_t)
    cdef Py_ssize_t _walk(
        self, const unsigned char* data, Py_ssize_t end, const unsigned char* links,
        unsigned char* entries, Py_ssize_t count, Py_ssize_t most, unsigned char* rows,
        const unsigned char* ports
    ) noexcept nogil
